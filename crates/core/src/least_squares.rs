//! The only loop that takes steps on a pose: Levenberg–Marquardt on small left motions.
