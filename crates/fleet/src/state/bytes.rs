//! States as bytes, for engines that keep parts of a fleet on many machines: version, period, then each camera by name. Little endian.

use super::{CameraState, FleetState, Sample, Sums};
use crate::FleetError;
use std::sync::PoisonError;

/// The first bytes; the last one is the version.
const MAGIC: [u8; 8] = *b"resight\x04";

impl FleetState {
    /// The state as bytes, the same ones whatever the order in which its rows came.
    pub fn to_bytes(&self) -> Vec<u8> {
        self.bytes_of(|_| true, *self.unnamed.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// A state for each camera, by name; merged they are this one but for the rows that name no camera.
    pub fn split(&self) -> Vec<(String, Vec<u8>)> {
        let names = self.spans().into_iter().map(|(name, _)| name);
        names.map(|name| (name.clone(), self.bytes_of(|other| *other == name, [0; 6]))).collect()
    }

    fn bytes_of(&self, is_meant: impl Fn(&String) -> bool, unnamed: [u64; 6]) -> Vec<u8> {
        let mut cameras: Vec<(String, Vec<u8>)> = Vec::new();
        for shard in &self.shards {
            let shard = shard.lock().unwrap_or_else(PoisonError::into_inner);
            for (name, camera) in shard.iter().filter(|(name, _)| is_meant(name)) {
                let mut out = Writer::default();
                camera.write(&mut out);
                cameras.push((name.clone(), out.0));
            }
        }
        cameras.sort();
        let mut out = Writer(MAGIC.to_vec());
        out.float(self.period_s);
        unnamed.into_iter().for_each(|n| out.whole(n));
        out.whole(cameras.len() as u64);
        for (name, bytes) in cameras {
            out.whole(name.len() as u64);
            out.0.extend(name.as_bytes());
            out.0.extend(bytes);
        }
        out.0
    }

    /// The state that `to_bytes` or `split` wrote.
    ///
    /// # Errors
    /// `Setting` for other bytes.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, FleetError> {
        Self::read(bytes).ok_or_else(|| {
            let n = bytes.len();
            let reason =
                format!("these {n} bytes are no state of a fleet of this version; give what to_bytes wrote");
            FleetError::Setting(reason)
        })
    }

    fn read(bytes: &[u8]) -> Option<Self> {
        let mut from = Reader(bytes.strip_prefix(&MAGIC)?);
        let state = FleetState::new(Some(from.float()?).filter(|s| 0.0 < *s && s.is_finite())?);
        let unnamed = from.counts()?;
        state.add_unnamed(unnamed);
        for _ in 0..from.whole()? {
            let n = from.count()?;
            let name = String::from_utf8(from.take(n)?.to_vec()).ok()?;
            state.enter(name, CameraState::read(&mut from)?);
        }
        from.0.is_empty().then_some(state)
    }
}

impl CameraState {
    fn write(&self, out: &mut Writer) {
        self.counts.into_iter().chain([self.without_time, self.too_far]).for_each(|n| out.whole(n));
        // Without a time no span: NaN, which no time is.
        let (first, last) = self.span_s.unwrap_or((f64::NAN, f64::NAN));
        out.float(first);
        out.float(last);
        out.whole(self.periods.len() as u64);
        for (period, sums) in &self.periods {
            out.whole(*period as u64);
            sums.parts().into_iter().for_each(|n| out.whole(n));
        }
        out.whole(self.samples.len() as u64);
        for sample in &self.samples {
            out.whole(sample.key);
            out.whole(sample.time);
            sample.covariance.iter().for_each(|x| out.float(*x));
        }
    }

    fn read(from: &mut Reader) -> Option<Self> {
        let (counts, without_time, too_far) = (from.counts()?, from.whole()?, from.whole()?);
        let span = (from.float()?, from.float()?);
        let mut periods = Vec::new();
        for _ in 0..from.count()? {
            let period = from.whole()? as i64;
            let mut parts = [0; Sums::PARTS];
            for part in &mut parts {
                *part = from.whole()?;
            }
            periods.push((period, Sums::of_parts(parts)?));
        }
        let mut samples = Vec::new();
        for _ in 0..from.count()? {
            samples.push(Sample { key: from.whole()?, time: from.whole()?, covariance: from.floats()? });
        }
        let is_rising = periods.windows(2).all(|w| w[0].0 < w[1].0);
        let span_s = (!span.0.is_nan() && !span.1.is_nan()).then_some(span);
        is_rising.then_some(CameraState { counts, without_time, too_far, span_s, periods, samples })
    }
}

#[derive(Default)]
struct Writer(Vec<u8>);

impl Writer {
    fn whole(&mut self, n: u64) {
        self.0.extend(n.to_le_bytes());
    }

    fn float(&mut self, x: f64) {
        self.whole(x.to_bits());
    }
}

struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn take(&mut self, n: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(n)?;
        self.0 = rest;
        Some(taken)
    }

    fn whole(&mut self) -> Option<u64> {
        Some(u64::from_le_bytes(self.take(8)?.try_into().ok()?))
    }

    /// How many follow, of which each has a byte at least.
    fn count(&mut self) -> Option<usize> {
        usize::try_from(self.whole()?).ok().filter(|n| *n <= self.0.len())
    }

    fn counts(&mut self) -> Option<[u64; 6]> {
        let mut counts = [0; 6];
        for n in &mut counts {
            *n = self.whole()?;
        }
        Some(counts)
    }

    fn float(&mut self) -> Option<f64> {
        Some(f64::from_bits(self.whole()?))
    }

    fn floats<const N: usize>(&mut self) -> Option<[f64; N]> {
        let mut floats = [0.0; N];
        for x in &mut floats {
            *x = self.float()?;
        }
        Some(floats)
    }
}
