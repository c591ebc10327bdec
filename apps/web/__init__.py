"""Pages in the browser: a viewer of runs, an editor of bundles."""
