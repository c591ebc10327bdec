"""The body that drawings show: their visual hull, or the mannequin where that is it."""
