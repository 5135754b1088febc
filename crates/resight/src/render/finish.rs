//! The effects of light, lens and sensor: illumination gradient, Gaussian blur, noise, rounding.

/// PCG-XSH-RR 64/32 (M. O'Neill, 2014): small, seeded, the same on every machine.
#[derive(Debug, Clone)]
pub struct Pcg {
    state: u64,
    spare: Option<f64>,
}

impl Pcg {
    /// Creates a generator; equal seeds give equal sequences.
    pub fn new(seed: u64) -> Self {
        let mut pcg = Pcg { state: seed.wrapping_add(0x853c_49e6_748f_ea9b), spare: None };
        pcg.next_u32();
        pcg
    }

    /// Returns 32 random bits.
    pub fn next_u32(&mut self) -> u32 {
        let old = self.state;
        self.state = old.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let shifted = (((old >> 18) ^ old) >> 27) as u32;
        shifted.rotate_right((old >> 59) as u32)
    }

    /// Returns a uniform number in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        self.next_u32() as f64 / 4_294_967_296.0
    }

    /// Returns a uniform number in [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Returns a standard normal number, by Marsaglia's polar method.
    pub fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        loop {
            let (x, y) = (self.between(-1.0, 1.0), self.between(-1.0, 1.0));
            let s = x * x + y * y;
            if 0.0 < s && s < 1.0 {
                let scale = (-2.0 * s.ln() / s).sqrt();
                self.spare = Some(y * scale);
                return x * scale;
            }
        }
    }
}

/// Multiplies by 1 + gx·(u/w − ½) + gy·(v/h − ½).
pub(super) fn illuminate(grey: &mut [f32], width: usize, [gx, gy]: [f64; 2]) {
    if (gx == 0.0 && gy == 0.0) || width == 0 {
        return;
    }
    let height = grey.len() / width;
    for (v, row) in grey.chunks_mut(width).enumerate() {
        let down = 1.0 + gy * (v as f64 / height as f64 - 0.5);
        for (u, value) in row.iter_mut().enumerate() {
            *value *= (down + gx * (u as f64 / width as f64 - 0.5)) as f32;
        }
    }
}

/// Multiplies by 1 − loss·ρ², where ρ is the distance from the centre of the image over that of its corners.
pub(super) fn vignette(grey: &mut [f32], width: usize, loss: f64) {
    if loss == 0.0 || width == 0 {
        return;
    }
    let height = grey.len() / width;
    let centred = |i: usize, n: usize| 2.0 * (i as f64 + 0.5) / n as f64 - 1.0;
    for (v, row) in grey.chunks_mut(width).enumerate() {
        let down = centred(v, height).powi(2);
        for (u, value) in row.iter_mut().enumerate() {
            *value *= (1.0 - 0.5 * loss * (down + centred(u, width).powi(2))) as f32;
        }
    }
}

/// Applies a separable Gaussian blur, cut at 4 sigma; the border pixels are repeated outside.
pub(super) fn blur(grey: &mut [f32], width: usize, sigma_px: f64) {
    if !(0.0 < sigma_px) || width == 0 {
        return;
    }
    let kernel = gaussian(sigma_px);
    let height = grey.len() / width;
    let reach = kernel.len() / 2;
    let mut padded = vec![0.0; width + 2 * reach];
    for row in grey.chunks_mut(width) {
        let (first, last) = (row[0], row[width - 1]);
        padded[..reach].fill(first);
        padded[reach..reach + width].copy_from_slice(row);
        padded[reach + width..].fill(last);
        for (u, value) in row.iter_mut().enumerate() {
            *value = kernel.iter().zip(&padded[u..]).map(|(k, x)| k * x).sum();
        }
    }
    let source = grey.to_vec();
    for (v, row) in grey.chunks_mut(width).enumerate() {
        row.fill(0.0);
        for (i, k) in kernel.iter().enumerate() {
            let from = (v + i).saturating_sub(reach).min(height - 1);
            let line = &source[from * width..(from + 1) * width];
            row.iter_mut().zip(line).for_each(|(value, x)| *value += k * x);
        }
    }
}

fn gaussian(sigma_px: f64) -> Vec<f32> {
    let reach = (4.0 * sigma_px).ceil() as i64;
    let weights: Vec<f64> = (-reach..=reach).map(|i| (-0.5 * (i as f64 / sigma_px).powi(2)).exp()).collect();
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|w| (w / sum) as f32).collect()
}

/// Adds noise, rounds, and clips to 0…255.
pub(super) fn expose(grey: &[f32], noise_sigma: f64, seed: u64) -> Vec<u8> {
    let mut pcg = Pcg::new(seed);
    let noisy = 0.0 < noise_sigma;
    grey.iter()
        .map(|g| {
            let noise = if noisy { noise_sigma * pcg.normal() } else { 0.0 };
            (*g as f64 + noise).round().clamp(0.0, 255.0) as u8
        })
        .collect()
}
