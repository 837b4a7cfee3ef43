"""Speed of the whole chain against its error, over fidelities."""
