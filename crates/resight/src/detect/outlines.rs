//! Finds closed outlines with four sides, the only places for a tag: small or shadowed tags are decoded there, not in the whole image at full
//! size.
//!
//! Connected dark pixels (for some families, light ones) are collected row by row; only components that touch the previous row are kept in
//! memory. The border of a tag is one such component with four corners, dark just inside each side and light just outside. Letters, dots and
//! foliage are components too, and few of them have four such sides.

use super::region::Region;
use super::{light, stop, tiles};
use crate::GrayImage;
use resight_core::Pixel;

/// Corners of an outline, in order around it, in either direction.
pub(super) type Quad = [Pixel; 4];

/// The pixels that belong to outlines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ink {
    Dark,
    Light,
}

/// Shortest side of a readable tag, pixels, between the centres of its outermost pixels.
const LEAST_SIDE_PX: f64 = 7.0;
/// Number of positions along each side at which the inside is compared with the outside.
const PLACES: usize = 12;
/// Least share of positions with ink inside, for one side and for all: a border is closed;
const INSIDE: [f64; 2] = [0.75, 0.85];
/// and without ink outside: the corners of the smallest tags are round, and their sides are found a pixel off.
const OUTSIDE: [f64; 2] = [0.4, 0.65];
/// Distance of the outer position from the side, beyond half a cell, pixels.
const BEYOND_PX: f64 = 0.75;

/// Directions in which the outermost pixels of a component are kept: with eight, a corner between two of them would be mistaken for its
/// neighbour.
const DIRECTIONS: [[i32; 2]; 16] = [
    [1, 0],
    [2, 1],
    [1, 1],
    [1, 2],
    [0, 1],
    [-1, 2],
    [-1, 1],
    [-2, 1],
    [-1, 0],
    [-2, -1],
    [-1, -1],
    [-1, -2],
    [0, -1],
    [1, -2],
    [1, -1],
    [2, -1],
];

/// The outermost pixels of a component in each direction.
#[derive(Debug, Clone, Copy)]
struct Component {
    extremes: [[i32; 2]; DIRECTIONS.len()],
    /// The component to which it was joined; its own index where it was not.
    parent: usize,
    last_row: i32,
}

impl Component {
    fn new(index: usize, run: &Run, row: i32) -> Self {
        let mut component =
            Component { extremes: [[run.first, row]; DIRECTIONS.len()], parent: index, last_row: row };
        component.take_run(run, row);
        component
    }

    /// Takes the pixels of a run: its last one to the right, its first one to the left.
    fn take_run(&mut self, run: &Run, row: i32) {
        (0..=4).chain(12..16).for_each(|k| self.take(k, [run.last, row]));
        (4..=12).for_each(|k| self.take(k, [run.first, row]));
    }

    fn take(&mut self, direction: usize, place: [i32; 2]) {
        let ([u, v], extreme) = (DIRECTIONS[direction], &mut self.extremes[direction]);
        if u * extreme[0] + v * extreme[1] < u * place[0] + v * place[1] {
            *extreme = place;
        }
    }
}

/// Adjacent pixels of a row that have ink.
#[derive(Debug, Clone, Copy)]
struct Run {
    first: i32,
    last: i32,
    component: usize,
}

/// Components that touch the current or the previous row.
#[derive(Default)]
struct Components {
    all: Vec<Component>,
    free: Vec<usize>,
    /// Components joined to another in the current row.
    joined: Vec<usize>,
}

impl Components {
    fn add(&mut self, run: &Run, row: i32) -> usize {
        let index = self.free.pop().unwrap_or(self.all.len());
        let component = Component::new(index, run, row);
        match self.all.get_mut(index) {
            Some(place) => *place = component,
            None => self.all.push(component),
        }
        index
    }

    fn root(&self, mut index: usize) -> usize {
        while self.all[index].parent != index {
            index = self.all[index].parent;
        }
        index
    }

    fn join(&mut self, a: usize, b: usize) -> usize {
        let (a, b) = (self.root(a), self.root(b));
        if a != b {
            let other = self.all[b];
            (0..DIRECTIONS.len()).for_each(|k| self.all[a].take(k, other.extremes[k]));
            self.all[b].parent = a;
            self.joined.push(b);
        }
        a
    }
}

/// Cost of stretching a pixel and finding outlines: a sixth of the tag library's search of one pixel, from timing both in an image with clutter.
#[cfg(test)]
const PASS: usize = 6;

/// Returns the closed outlines with four sides in an image with grey levels around 127, as [`light::stretched`](super::light::stretched) makes
/// them, for a tag with `border_cells` cells along each side of its border.
pub(super) fn quads(image: &GrayImage, ink: Ink, border_cells: i32) -> Vec<Quad> {
    if stop::is_stopped() {
        return Vec::new();
    }
    #[cfg(test)]
    super::work::count(image.data.len() / PASS);
    let width = image.width_px.max(1) as usize;
    let has_ink = |gray: u8| match ink {
        Ink::Dark => gray < MIDDLE,
        Ink::Light => MIDDLE < gray,
    };
    let mut components = Components::default();
    let (mut before, mut runs): (Vec<Run>, Vec<Run>) = (Vec::new(), Vec::new());
    let mut found = Vec::new();
    for (row, pixels) in (0..).zip(image.data.chunks(width)) {
        find_runs(pixels, has_ink, &mut runs);
        connect(&before, &mut runs, row, &mut components);
        close(&before, row, &mut components, |component| found.extend(quad(component)));
        std::mem::swap(&mut before, &mut runs);
    }
    close(&before, i32::MAX, &mut components, |component| found.extend(quad(component)));
    found.retain(|quad| has_border(image, quad, has_ink, border_cells));
    found
}

/// Returns the closed outlines with four sides in an original image of any size, where grey levels differ by at least `least_gray`. `None` where
/// the image is too small.
pub(super) fn of(image: &GrayImage, least_gray: u8, inks: &[Ink], border_cells: i32) -> Option<Vec<Quad>> {
    if !light::has_structure(image, least_gray) {
        return Some(Vec::new());
    }
    let mut tile = GrayImage::filled(0, 0, 0);
    let mut all = Vec::new();
    for part in tiles::parts([image.width_px, image.height_px]) {
        part.cut(image, &mut tile)?;
        let stretched = light::stretched(&tile, least_gray)?;
        let found = inks.iter().flat_map(|ink| quads(&stretched, *ink, border_cells));
        all.extend(found.map(|quad| quad.map(|corner| corner + part.origin())));
    }
    Some(all)
}

/// More outlines than this, or as many as an image has room for, indicate a texture, and the image is searched as a whole.
const MOST_OUTLINES: usize = 400;

/// Returns whether the parts around the outlines have about the area of the whole image.
pub(super) fn is_texture(around: &[Region], image: &GrayImage) -> bool {
    let area_px: u64 = around.iter().map(Region::area_px).sum();
    MOST_OUTLINES < around.len() || image.data.len() as u64 <= area_px
}

/// Number of pixels that are tested for ink at once.
const CHUNK: usize = 32;

/// The middle of the grey levels, for pixels that are neither black nor white.
const MIDDLE: u8 = 127;

fn find_runs(pixels: &[u8], has_ink: impl Fn(u8) -> bool, runs: &mut Vec<Run>) {
    runs.clear();
    let mut at = 0;
    loop {
        // Most of an image has no ink: it is passed over many pixels at a time.
        let is_bare = |some: &&[u8]| !some.iter().fold(false, |any, gray| any | has_ink(*gray));
        at += CHUNK * pixels[at..].chunks_exact(CHUNK).take_while(is_bare).count();
        let Some(first) = pixels[at..].iter().position(|gray| has_ink(*gray)) else { break };
        let first = at + first;
        let length = pixels[first..].iter().position(|gray| !has_ink(*gray)).unwrap_or(pixels.len() - first);
        at = first + length;
        runs.push(Run { first: first as i32, last: at as i32 - 1, component: usize::MAX });
    }
}

/// Assigns the runs of a row to components, by the runs of the previous row that touch them with a side of a pixel.
fn connect(before: &[Run], runs: &mut [Run], row: i32, components: &mut Components) {
    let mut next = 0;
    for run in runs.iter_mut() {
        while next < before.len() && before[next].last < run.first {
            next += 1;
        }
        let touching = before[next..].iter().take_while(|other| other.first <= run.last);
        let mut own = None;
        for other in touching {
            own = Some(match own {
                None => components.root(other.component),
                Some(own) => components.join(own, other.component),
            });
        }
        run.component = match own {
            None => components.add(run, row),
            Some(own) => {
                let component = &mut components.all[own];
                component.last_row = row;
                component.take_run(run, row);
                own
            }
        };
    }
    for run in runs.iter_mut() {
        run.component = components.root(run.component);
        components.all[run.component].last_row = row;
    }
}

/// Passes on the components that end before a row, and frees their memory.
fn close(before: &[Run], row: i32, components: &mut Components, mut done: impl FnMut(&Component)) {
    for run in before {
        let index = components.root(run.component);
        if components.all[index].last_row < row {
            done(&components.all[index]);
            components.all[index].last_row = i32::MAX;
            components.free.push(index);
        }
    }
    components.free.append(&mut components.joined);
}

/// Returns the four corners of a component: its longest diagonal and the farthest pixels on both sides of it.
fn quad(component: &Component) -> Option<Quad> {
    // Specks are not looked at any further.
    let reach = |axis: usize, [most, least]: [usize; 2]| {
        f64::from(component.extremes[most][axis] - component.extremes[least][axis])
    };
    if reach(0, [0, 8]).max(reach(1, [4, 12])) < LEAST_SIDE_PX {
        return None;
    }
    let places = component.extremes.map(|[u, v]| Pixel::new(f64::from(u), f64::from(v)));
    let pairs = (0..places.len()).flat_map(|i| (0..i).map(move |k| (i, k)));
    let apart = |(i, k): (usize, usize)| (places[i] - places[k]).norm_squared();
    let (i, k) = pairs.max_by(|a, b| apart(*a).total_cmp(&apart(*b)))?;
    let (a, c) = (places[i], places[k]);
    let side = |p: &Pixel| (c.x - a.x) * (p.y - a.y) - (c.y - a.y) * (p.x - a.x);
    let by_side = |p: &&Pixel, q: &&Pixel| side(p).total_cmp(&side(q));
    let (b, d) = (*places.iter().max_by(by_side)?, *places.iter().min_by(by_side)?);
    let quad = [a, b, c, d];
    let shortest = (0..4).map(|k| (quad[(k + 1) % 4] - quad[k]).norm()).fold(f64::INFINITY, f64::min);
    (LEAST_SIDE_PX <= shortest).then_some(quad)
}

/// Returns whether there is ink along the inside of all four sides, and none along their outside.
fn has_border(image: &GrayImage, quad: &Quad, has_ink: impl Fn(u8) -> bool, border_cells: i32) -> bool {
    let middle = quad.iter().sum::<Pixel>() / 4.0;
    let at = |p: Pixel| {
        let inside = |x: f64, n: u32| -0.5 <= x && x < n as f64 - 0.5;
        let is_in = inside(p.x, image.width_px) && inside(p.y, image.height_px);
        is_in.then(|| has_ink(image.at(p.x.round() as u32, p.y.round() as u32)))
    };
    let mut sums = [0, 0];
    for k in 0..4 {
        let (a, b) = (quad[k], quad[(k + 1) % 4]);
        let mut right = [0, 0];
        for i in 0..PLACES {
            let place = a + (b - a) * ((i as f64 + 1.0) / (PLACES as f64 + 1.0));
            let inwards = middle - place;
            // Half a cell, but at least a pixel, because the corners are the centres of pixels.
            let half_cell =
                inwards * (1.0 / f64::from(border_cells.max(1))).max(1.0 / inwards.norm().max(1.0));
            right[0] += usize::from(at(place + 0.5 * half_cell) == Some(true));
            right[1] += usize::from(at(place - half_cell - inwards.normalize() * BEYOND_PX) == Some(false));
        }
        let is_open = |(n, least): (&usize, [f64; 2])| (*n as f64) < least[0] * PLACES as f64;
        if right.iter().zip([INSIDE, OUTSIDE]).any(is_open) {
            return false;
        }
        (0..2).for_each(|k| sums[k] += right[k]);
    }
    let is_closed = |(n, least): (&usize, [f64; 2])| least[1] * (4 * PLACES) as f64 <= *n as f64;
    sums.iter().zip([INSIDE, OUTSIDE]).all(is_closed)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// White, with black where `is_black`.
    fn image(is_black: impl Fn(f64, f64) -> bool) -> GrayImage {
        let gray = |k: usize| if is_black((k % 120) as f64, (k / 120) as f64) { 0 } else { 255 };
        GrayImage { width_px: 120, height_px: 100, data: (0..120 * 100).map(gray).collect() }
    }

    /// A ring of a square of this edge, rotated, two pixels thick, with a spot in it.
    fn ring(centre: [f64; 2], edge: f64, angle: f64) -> impl Fn(f64, f64) -> bool {
        move |u, v| {
            let (x, y) = (u - centre[0], v - centre[1]);
            let (x, y) = (x * angle.cos() + y * angle.sin(), y * angle.cos() - x * angle.sin());
            let reach = x.abs().max(y.abs());
            (0.5 * edge - 2.0..=0.5 * edge).contains(&reach) || reach < 2.0
        }
    }

    #[test]
    fn squares_are_found_at_their_corners_whatever_their_angle() {
        for angle in [0.0, 0.2, 0.5, 0.8, 1.3] {
            let image = image(ring([60.0, 50.0], 24.0, angle));
            let found = quads(&image, Ink::Dark, 10);
            assert_eq!(found.len(), 1, "{angle}");
            for (x, y) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
                let (x, y) = (12.0 * x, 12.0 * y);
                let corner = Pixel::new(
                    60.0 + x * f64::cos(angle) - y * f64::sin(angle),
                    50.0 + x * f64::sin(angle) + y * f64::cos(angle),
                );
                let off = found[0].iter().map(|p| (p - corner).norm()).fold(f64::INFINITY, f64::min);
                assert!(off < 2.0, "{angle}: {off}");
            }
        }
    }

    #[test]
    fn dots_and_letters_are_none() {
        let dot = |u: f64, v: f64| (u - 30.0).hypot(v - 30.0) < 12.0;
        let bar = |u: f64, v: f64, left: f64, top: f64, w: f64, h: f64| {
            (left..left + w).contains(&u) && (top..top + h).contains(&v)
        };
        let letter_e = move |u: f64, v: f64| {
            bar(u, v, 60.0, 20.0, 3.0, 21.0)
                || [20.0, 29.0, 38.0].iter().any(|top| bar(u, v, 60.0, *top, 15.0, 3.0))
        };
        let letter_h = move |u: f64, v: f64| {
            bar(u, v, 90.0, 20.0, 3.0, 21.0)
                || bar(u, v, 102.0, 20.0, 3.0, 21.0)
                || bar(u, v, 90.0, 29.0, 15.0, 3.0)
        };
        let none = image(|u, v| dot(u, v) || letter_e(u, v) || letter_h(u, v));
        assert_eq!(quads(&none, Ink::Dark, 8), Vec::<Quad>::new());
        assert_eq!(quads(&GrayImage::filled(120, 100, MIDDLE), Ink::Dark, 8), Vec::<Quad>::new());
        assert_eq!(quads(&GrayImage::filled(0, 0, 0), Ink::Dark, 8), Vec::<Quad>::new());
    }

    #[test]
    fn light_outlines_are_those_of_the_inverted_image() {
        let dark = image(ring([40.0, 40.0], 30.0, 0.3));
        let light = GrayImage { data: dark.data.iter().map(|gray| 255 - gray).collect(), ..dark.clone() };
        assert_eq!(quads(&light, Ink::Light, 8), quads(&dark, Ink::Dark, 8));
    }

    /// Components are merged late, as for the arms of a U, and their memory is reused.
    #[test]
    fn many_components_at_once_are_kept_apart() {
        let comb = |u: f64, v: f64| v < 20.0 && (u as u32).is_multiple_of(3) || (18.0..20.0).contains(&v);
        let square = ring([60.0, 60.0], 20.0, 0.0);
        let found = quads(&image(|u, v| comb(u, v) || square(u, v)), Ink::Dark, 8);
        assert_eq!(found.len(), 1);
        assert!(found[0].iter().all(|p| (p - Pixel::new(60.0, 60.0)).norm() < 16.0), "{found:?}");
    }
}
