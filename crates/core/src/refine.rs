//! One pose: reprojection residual, Jacobian, covariance.
