"""The job: stages in order, from a scene file to an edited scene on disk."""
