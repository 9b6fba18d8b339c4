"""The import formats, one module each: a module declares its `mofit.data.importers.registry.ImportFormat`."""
