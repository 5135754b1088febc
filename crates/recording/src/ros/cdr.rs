//! Values to CDR, little end first: what ROS 2 writes on the machines it runs on.

/// A message being written.
pub(super) struct Cdr {
    bytes: Vec<u8>,
}

impl Cdr {
    pub fn new() -> Self {
        Cdr { bytes: vec![0, 1, 0, 0] }
    }

    pub fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    /// Numbers lie at multiples of their size, counted from behind the four bytes of the header.
    fn number<const N: usize>(mut self, bytes: [u8; N]) -> Self {
        while !(self.bytes.len() - 4).is_multiple_of(N) {
            self.bytes.push(0);
        }
        self.bytes.extend(bytes);
        self
    }

    pub fn u8(self, value: u8) -> Self {
        self.number([value])
    }

    pub fn u32(self, value: u32) -> Self {
        self.number(value.to_le_bytes())
    }

    pub fn f64(self, value: f64) -> Self {
        self.number(value.to_le_bytes())
    }

    pub fn f64s(self, values: impl IntoIterator<Item = f64>) -> Self {
        values.into_iter().fold(self, Cdr::f64)
    }

    pub fn text(self, text: &str) -> Self {
        let mut cdr = self.u32(text.len() as u32 + 1);
        cdr.bytes.extend(text.as_bytes());
        cdr.bytes.push(0);
        cdr
    }

    /// Stamp and frame. Times before 1970 do not exist there.
    pub fn header(self, time_ns: u64, frame: &str) -> Self {
        let (seconds, rest) = (time_ns / 1_000_000_000, time_ns % 1_000_000_000);
        self.u32(seconds as u32).u32(rest as u32).text(frame)
    }

    /// `x, y, z, w`.
    pub fn quaternion(self, [w, x, y, z]: [f64; 4]) -> Self {
        self.f64s([x, y, z, w])
    }
}
