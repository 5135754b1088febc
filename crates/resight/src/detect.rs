//! Finding targets in images.
