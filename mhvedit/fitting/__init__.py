"""A skeleton inside a volumetric capture: fitted, judged, and used to change the capture itself."""
