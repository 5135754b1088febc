//! Vectors and covariances as little-endian doubles: a covariance is its upper triangle, row by row.

use nalgebra::{SMatrix, SVector};

/// Rows and columns of the upper triangle of an n×n matrix, row by row.
pub(super) fn triangle(n: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..n).flat_map(move |i| (i..n).map(move |j| (i, j)))
}

pub(super) fn of_matrix<const N: usize>(matrix: &SMatrix<f64, N, N>) -> Vec<u8> {
    triangle(N).flat_map(|place| matrix[place].to_le_bytes()).collect()
}

/// Returns `None` where the bytes are not such a triangle.
pub(super) fn to_matrix<const N: usize>(bytes: &[u8]) -> Option<SMatrix<f64, N, N>> {
    let numbers = numbers(bytes, N * (N + 1) / 2)?;
    let mut matrix = SMatrix::zeros();
    for ((i, j), value) in triangle(N).zip(numbers) {
        (matrix[(i, j)], matrix[(j, i)]) = (value, value);
    }
    Some(matrix)
}

pub(super) fn of_vector<const N: usize>(vector: &SVector<f64, N>) -> Vec<u8> {
    vector.iter().flat_map(|x| x.to_le_bytes()).collect()
}

/// Returns `None` where the bytes are not N numbers.
pub(super) fn to_vector<const N: usize>(bytes: &[u8]) -> Option<SVector<f64, N>> {
    numbers(bytes, N).map(SVector::from_iterator)
}

fn numbers(bytes: &[u8], n: usize) -> Option<impl Iterator<Item = f64>> {
    let (eights, rest) = bytes.as_chunks::<8>();
    (eights.len() == n && rest.is_empty()).then(|| eights.iter().map(|eight| f64::from_le_bytes(*eight)))
}
