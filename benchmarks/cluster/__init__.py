"""Jobs on a cluster: how the time of a build and of sequences falls with the number of workers."""
