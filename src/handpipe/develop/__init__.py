"""Commands of developers: compare two results folders, make the page of results from metrics."""
