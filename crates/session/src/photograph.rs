//! A photograph: the original file, its grey pixels for detectors, and its EXIF data.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use resight::GrayImage;
use resight::core::camera::ImageSize;
use resight::image::exif::{self, ExifCamera, ExifLens, Heading};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use sha2::{Digest, Sha256};

/// A decoded photograph.
#[derive(Clone)]
pub struct Photograph {
    /// The name of its file, without a folder.
    pub name: String,
    /// SHA-256 of the file, in hexadecimal: what it is known by, for files of one name may show different things.
    pub sha256: String,
    /// The file: PNG or JPEG.
    pub bytes: Vec<u8>,
    /// Its pixels.
    pub image: GrayImage,
    /// The lens with which it was taken, where it is stated.
    pub exif: Option<ExifLens>,
    /// The camera, where it is stated.
    pub camera: Option<ExifCamera>,
    /// The direction of the camera, where it is stated.
    pub heading: Option<Heading>,
    /// The time when it was taken, seconds since 1970 by the camera's clock, where it is stated.
    pub taken_s: Option<f64>,
}

impl PartialEq for Photograph {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name && self.sha256 == other.sha256
    }
}

impl std::fmt::Debug for Photograph {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} ({} × {} px)", self.name, self.image.width_px, self.image.height_px)
    }
}

/// Longest name of a file, bytes.
const NAME_BYTES: usize = 200;

impl Photograph {
    /// Decodes a PNG or JPEG file. The pixels stay as they are in the file: an orientation in EXIF is not applied, for lenses are calibrated
    /// without it.
    ///
    /// # Errors
    /// A sentence: no image, too large, torn.
    pub fn decode(name: &str, bytes: Vec<u8>) -> Result<Self, String> {
        let image = GrayImage::decode(&bytes)?;
        let (exif, heading, taken_s) = (exif::lens(&bytes), exif::heading(&bytes), exif::taken_s(&bytes));
        let camera = exif::camera(&bytes);
        let sha256 = Sha256::digest(&bytes).iter().map(|b| format!("{b:02x}")).collect();
        Ok(Photograph { name: plain_name(name), sha256, bytes, image, exif, camera, heading, taken_s })
    }

    /// Returns a copy without file and pixels.
    pub(crate) fn bare(&self) -> Self {
        let (name, sha256) = (self.name.clone(), self.sha256.clone());
        let (exif, camera) = (self.exif.clone(), self.camera.clone());
        let (heading, taken_s) = (self.heading, self.taken_s);
        let (bytes, image) = (Vec::new(), GrayImage::filled(0, 0, 0));
        Photograph { name, sha256, bytes, image, exif, camera, heading, taken_s }
    }

    /// Memory that it takes.
    pub fn weight_bytes(&self) -> usize {
        self.bytes.len() + self.image.data.len()
    }

    /// Returns its size.
    pub fn size(&self) -> ImageSize {
        ImageSize { width_px: self.image.width_px, height_px: self.image.height_px }
    }

    /// `image/png` or `image/jpeg`.
    pub fn media_type(&self) -> &'static str {
        if self.bytes.starts_with(b"\x89PNG") { "image/png" } else { "image/jpeg" }
    }
}

/// The last part of a name, without control characters.
fn plain_name(name: &str) -> String {
    let last = name.rsplit(['/', '\\']).next().unwrap_or_default();
    let mut plain: String = last.chars().filter(|c| !c.is_control()).collect();
    while NAME_BYTES < plain.len() {
        plain.pop();
    }
    if plain.is_empty() { "photograph".to_owned() } else { plain }
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Saved {
    name: String,
    /// Written for readers that have the file already; other readers compute it themselves.
    #[serde(default)]
    sha256: Option<String>,
    image_base64: String,
}

impl Serialize for Photograph {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let (name, sha256) = (self.name.clone(), Some(self.sha256.clone()));
        Saved { name, sha256, image_base64: STANDARD.encode(&self.bytes) }.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Photograph {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let saved = Saved::deserialize(deserializer)?;
        let bytes = STANDARD.decode(saved.image_base64).map_err(serde::de::Error::custom)?;
        Photograph::decode(&saved.name, bytes).map_err(serde::de::Error::custom)
    }
}

/// Photographs are shared by the steps that can be undone, and saved once.
pub mod shared {
    use super::Photograph;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};
    use std::sync::Arc;

    pub fn serialize<S: Serializer>(photograph: &Arc<Photograph>, serializer: S) -> Result<S::Ok, S::Error> {
        Photograph::serialize(photograph, serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Arc<Photograph>, D::Error> {
        Photograph::deserialize(deserializer).map(Arc::new)
    }
}
