//! A target that no image has shown yet: what the first image shows instead, found when nothing was read for long, or at the end.

use resight::GrayImage;
use resight::detect::absent::not_found;
use resight_core::Target;

/// What is known of a target that was not found.
#[derive(Debug, Default)]
pub(super) enum Unseen {
    /// There was no image.
    #[default]
    NoImage,
    /// The first image.
    Missed(Box<GrayImage>),
    /// What that image shows instead.
    Explained(String),
    /// The target was found before.
    Found,
}

impl Unseen {
    /// Takes in an image without the target.
    pub fn miss(&mut self, image: &GrayImage) {
        if let Unseen::NoImage = self {
            *self = Unseen::Missed(Box::new(image.clone()));
        }
    }

    /// Takes in that the target was found.
    pub fn find(&mut self) {
        *self = Unseen::Found;
    }

    /// Searches the first image for what it shows instead; only once, because it takes several searches.
    pub fn explain(&mut self, target: &Target) {
        if let Unseen::Missed(image) = self {
            *self = Unseen::Explained(not_found(target, image));
        }
    }

    /// Returns what the first image shows instead, once that was searched for.
    pub fn explanation(&self) -> Option<&str> {
        match self {
            Unseen::Explained(text) => Some(text),
            _ => None,
        }
    }
}
