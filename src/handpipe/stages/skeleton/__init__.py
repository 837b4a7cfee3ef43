"""The skeleton: registration of bones and the rig."""
