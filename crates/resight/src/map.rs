//! Makes a map of tags: the pose of every tag of a place, from one camera that was carried through it. The job of `resight map`.

mod observed;
mod table;
mod job;

use crate::core::correspondence::Detection;
use crate::core::target::TagMap;
use crate::error::Error;
use crate::formats::NamedCamera;
use std::collections::BTreeMap;

pub use job::{map_from_images, map_from_rows};
pub use observed::MapImage;
pub use table::{TagRow, read_tag_rows};

/// The camera, the tags and what is known of them.
#[derive(Debug, Clone)]
pub struct MapRequest {
    /// The camera, which stays as it is given.
    pub camera: NamedCamera,
    /// The family of the tags.
    pub family: String,
    /// Outer edge of the black square of every tag without a size of its own, metres; `None` where each has one.
    pub size_m: Option<f64>,
    /// Sizes of single tags, metres.
    pub sizes_m: BTreeMap<u32, f64>,
    /// The tag whose frame is the world where no tag is known; by default the one that most views join to others.
    pub reference: Option<u32>,
    /// Tags whose poses are known with their covariance: from a survey or an earlier map. They determine the world.
    pub known: Option<TagMap>,
    /// Standard deviation of each coordinate of a corner, pixels, where rows state none.
    pub sigma_px: f64,
    /// Whether the answer's JSON holds the covariance of all tags together.
    pub joint_covariance: bool,
}

impl MapRequest {
    /// A request with default settings.
    pub fn new(camera: NamedCamera, family: impl Into<String>) -> Self {
        MapRequest {
            camera,
            family: family.into(),
            size_m: None,
            sizes_m: BTreeMap::new(),
            reference: None,
            known: None,
            sigma_px: 0.5,
            joint_covariance: false,
        }
    }

    fn check(&self) -> Result<(), Error> {
        let is_length = |x: &f64| 0.0 < *x && x.is_finite();
        let sizes = self.size_m.iter().map(|s| ("every tag".to_string(), s));
        let own = self.sizes_m.iter().map(|(id, s)| (format!("tag {id}"), s));
        if let Some((which, size)) = sizes.chain(own).find(|(_, s)| !is_length(s)) {
            return Err(Error::request(format!("the size of {which} is {size} m; it must be positive")));
        }
        if !is_length(&self.sigma_px) {
            return Err(Error::request(format!("sigma_px is {}; it must be positive", self.sigma_px)));
        }
        let other = self.known.as_ref().filter(|map| map.family != self.family);
        other.map_or(Ok(()), |map| {
            Err(Error::request(format!(
                "the known tags are of family {}, those of the images of {}; --family must be that of the map",
                map.family, self.family
            )))
        })
    }

    fn size_of(&self, id: u32) -> Option<f64> {
        let known = || self.known.as_ref()?.tags.iter().find(|tag| tag.id == id).map(|tag| tag.size_m);
        self.sizes_m.get(&id).copied().or_else(known).or(self.size_m)
    }
}

/// A view and the tags found in it, copies of an id included.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct TagView {
    pub(crate) name: String,
    pub(crate) tags: Vec<(u32, Vec<Detection>)>,
}

/// An input that took no part, with the reason.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MapLeftOut {
    /// Name of the view.
    pub view: String,
    /// `image`, or the tag.
    pub what: String,
    /// Why, in a sentence.
    pub reason: String,
}

/// Views in the order in which they were taken, and what was left out of them.
#[derive(Debug, Clone)]
pub(crate) struct Observed {
    pub(crate) camera: NamedCamera,
    pub(crate) n_images: usize,
    pub(crate) views: Vec<TagView>,
    pub(crate) left_out: Vec<MapLeftOut>,
    pub(crate) remarks: Vec<String>,
}
