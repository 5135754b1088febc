//! Rows of points and rows of text as batches of views.
