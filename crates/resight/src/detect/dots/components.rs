//! Connected regions of one class, built from runs joined by union–find: one pass, memory and time linear in the runs.

use super::threshold::NEITHER;

/// A connected region: area, box and second moments, enough to decide whether it may be the image of a disc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Component {
    /// `DARK` or `LIGHT`.
    pub class: u8,
    /// Number of pixels.
    pub area: f64,
    /// Mean column and row, pixels.
    pub mean: [f64; 2],
    /// Second central moments uu, uv, vv, px², of the pixels as unit squares.
    pub moments: [f64; 3],
    /// Whether it reaches the edge of the image, so that part of it may be outside.
    pub at_border: bool,
}

#[derive(Clone, Copy)]
struct Run {
    /// For a root, after all runs are joined: the index of its region.
    region: u32,
    start: u32,
    end: u32,
    parent: u32,
    class: u8,
}

/// Sums over the pixels of a region.
#[derive(Clone, Copy, Default)]
struct Sums {
    n: f64,
    u: f64,
    v: f64,
    uu: f64,
    uv: f64,
    vv: f64,
    at_border: bool,
    class: u8,
}

/// Largest number of runs (twenty bytes each) and of regions (seventy each). More come from noise with contrast, in which no dot is reported.
const MAX_RUNS: usize = 3_000_000;
const MAX_REGIONS: usize = 500_000;

/// Buffers that are reused between images, so that a stream does not allocate.
#[derive(Default)]
pub(super) struct Labeller {
    runs: Vec<Run>,
    row_starts: Vec<u32>,
    sums: Vec<Sums>,
}

impl Labeller {
    /// Returns the regions with `min_area ≤ area ≤ max_area`. Dark pixels are connected through their sides, light ones also through corners, so
    /// that a thin light line separates. An image with more runs or regions than the limits gives none, because nothing in it is conspicuous.
    pub fn components(
        &mut self,
        classes: &[u8],
        width: usize,
        min_area: f64,
        max_area: f64,
    ) -> Vec<Component> {
        if !self.find_runs(classes, width) {
            return Vec::new();
        }
        self.join();
        if !self.number_regions() {
            return Vec::new();
        }
        self.add_up(width);
        let wanted = |s: &&Sums| min_area <= s.n && s.n <= max_area && s.class != NEITHER;
        self.sums.iter().filter(wanted).map(Component::of).collect()
    }

    /// Finds the runs; returns whether there are few enough.
    fn find_runs(&mut self, classes: &[u8], width: usize) -> bool {
        self.runs.clear();
        self.row_starts.clear();
        for row in classes.chunks_exact(width.max(1)) {
            self.row_starts.push(self.runs.len() as u32);
            let mut start = 0;
            while start < row.len() {
                let class = row[start];
                let end = start + run_length(&row[start..], class);
                let parent = self.runs.len() as u32;
                self.runs.push(Run { region: 0, start: start as u32, end: end as u32, parent, class });
                if MAX_RUNS < self.runs.len() {
                    return false;
                }
                start = end;
            }
        }
        self.row_starts.push(self.runs.len() as u32);
        true
    }

    /// Joins the runs of each row with those of the row above that touch them.
    fn join(&mut self) {
        for row in 1..self.row_starts.len().saturating_sub(1) {
            let (mut above, mut here) = (self.row_starts[row - 1] as usize, self.row_starts[row] as usize);
            let (above_end, here_end) = (here, self.row_starts[row + 1] as usize);
            while above < above_end && here < here_end {
                let (a, b) = (self.runs[above], self.runs[here]);
                let reach = u32::from(a.class != super::threshold::DARK);
                if a.class == b.class && a.start < b.end + reach && b.start < a.end + reach {
                    self.unite(above as u32, here as u32);
                }
                // On a tie the next run above still touches this one through a corner, so only one side may advance; the skipped corner
                // (below-left) is handled from the other side.
                if a.end < b.end {
                    above += 1;
                } else if b.end < a.end {
                    here += 1;
                } else {
                    self.join_corners(above, here, above_end, here_end);
                    above += 1;
                    here += 1;
                }
            }
        }
    }

    /// Two runs that end at the same column: each may touch the other's right neighbour through a corner.
    fn join_corners(&mut self, above: usize, here: usize, above_end: usize, here_end: usize) {
        let joined = |x: &Run, y: &Run| x.class == y.class && x.class == super::threshold::LIGHT;
        if here + 1 < here_end && joined(&self.runs[above], &self.runs[here + 1]) {
            self.unite(above as u32, here as u32 + 1);
        }
        if above + 1 < above_end && joined(&self.runs[above + 1], &self.runs[here]) {
            self.unite(above as u32 + 1, here as u32);
        }
    }

    fn root(&mut self, mut i: u32) -> u32 {
        while self.runs[i as usize].parent != i {
            let up = self.runs[self.runs[i as usize].parent as usize].parent;
            self.runs[i as usize].parent = up;
            i = up;
        }
        i
    }

    fn unite(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        let (low, high) = (a.min(b), a.max(b));
        self.runs[high as usize].parent = low;
    }

    /// Gives each region its number and its sums; returns whether there are few enough.
    fn number_regions(&mut self) -> bool {
        let mut regions = 0;
        for i in 0..self.runs.len() {
            if self.runs[i].parent as usize == i {
                self.runs[i].region = regions;
                regions += 1;
            }
        }
        let few = regions as usize <= MAX_REGIONS;
        self.sums.clear();
        self.sums.resize(if few { regions as usize } else { 0 }, Sums { class: NEITHER, ..Sums::default() });
        few
    }

    fn add_up(&mut self, width: usize) {
        let last_row = self.row_starts.len().saturating_sub(2);
        for row in 0..self.row_starts.len().saturating_sub(1) {
            for i in self.row_starts[row]..self.row_starts[row + 1] {
                let root = self.root(i) as usize;
                let run = self.runs[i as usize];
                let edge = row == 0 || row == last_row || run.start == 0 || run.end as usize == width;
                self.sums[self.runs[root].region as usize].add(&run, row as f64, edge);
            }
        }
    }
}

/// Returns the number of leading bytes that equal `class`; compares eight at a time.
fn run_length(row: &[u8], class: u8) -> usize {
    let mut n = 0;
    for chunk in row.chunks_exact(8) {
        if chunk.iter().all(|c| *c == class) {
            n += 8;
        } else {
            break;
        }
    }
    n + row[n..].iter().take_while(|c| **c == class).count()
}

impl Sums {
    fn add(&mut self, run: &Run, v: f64, at_border: bool) {
        let n = (run.end - run.start) as f64;
        let middle = 0.5 * (run.start as f64 + run.end as f64 - 1.0);
        self.class = run.class;
        self.n += n;
        self.u += n * middle;
        self.v += n * v;
        // Σu² of n unit pixels in a row, each itself spread over ±1/2: n³/12 about their middle.
        self.uu += n * middle * middle + n * n * n / 12.0;
        self.uv += n * middle * v;
        self.vv += n * v * v + n / 12.0;
        self.at_border |= at_border;
    }
}

impl Component {
    fn of(s: &Sums) -> Component {
        let (u, v) = (s.u / s.n, s.v / s.n);
        let moments = [s.uu / s.n - u * u, s.uv / s.n - u * v, s.vv / s.n - v * v];
        Component { class: s.class, area: s.n, mean: [u, v], moments, at_border: s.at_border }
    }

    /// Returns the area divided by that of the ellipse of equal second moments: 1 for an ellipse, less for any other shape (0.955 for a
    /// rectangle, far less for rings and letters).
    pub fn ellipse_fill(&self) -> f64 {
        let [uu, uv, vv] = self.moments;
        self.area / (4.0 * std::f64::consts::PI * (uu * vv - uv * uv).max(1e-9).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::super::threshold::{DARK, LIGHT};
    use super::*;
    use crate::render::Pcg;

    /// Returns the area of each component of a class by flood fill: a slow, simple, independent method.
    fn flooded(classes: &[u8], width: usize, class: u8) -> Vec<usize> {
        let height = classes.len() / width;
        let mut seen = vec![false; classes.len()];
        let mut areas = Vec::new();
        for start in 0..classes.len() {
            if seen[start] || classes[start] != class {
                continue;
            }
            let (mut stack, mut area) = (vec![start], 0);
            seen[start] = true;
            while let Some(i) = stack.pop() {
                area += 1;
                let (u, v) = ((i % width) as i64, (i / width) as i64);
                for (du, dv) in (-1..=1).flat_map(|a| (-1..=1).map(move |b| (a, b))) {
                    let corner = du != 0 && dv != 0;
                    let (x, y) = (u + du, v + dv);
                    if (corner && class == DARK) || x < 0 || y < 0 || width as i64 <= x || height as i64 <= y
                    {
                        continue;
                    }
                    let j = y as usize * width + x as usize;
                    if !seen[j] && classes[j] == class {
                        seen[j] = true;
                        stack.push(j);
                    }
                }
            }
            areas.push(area);
        }
        areas.sort_unstable();
        areas
    }

    #[test]
    fn runs_join_as_flood_fill_does() {
        let mut pcg = Pcg::new(11);
        let mut labeller = Labeller::default();
        for case in 0..60 {
            let (width, height) = (1 + case % 23, 1 + case % 17);
            let density = pcg.between(0.2, 0.8);
            let classes: Vec<u8> = (0..width * height).map(|_| u8::from(pcg.uniform() < density)).collect();
            let found = labeller.components(&classes, width, 1.0, 1e9);
            for class in [DARK, LIGHT] {
                let mut areas: Vec<usize> =
                    found.iter().filter(|c| c.class == class).map(|c| c.area as usize).collect();
                areas.sort_unstable();
                assert_eq!(areas, flooded(&classes, width, class), "case {case} class {class}");
            }
        }
    }

    #[test]
    fn moments_of_a_rectangle_are_those_of_the_book() {
        let mut classes = vec![DARK; 40 * 30];
        for v in 10..16 {
            classes[v * 40 + 5..v * 40 + 25].fill(LIGHT);
        }
        let found = Labeller::default().components(&classes, 40, 1.0, 1000.0);
        let c = found.iter().find(|c| c.class == LIGHT).unwrap();
        assert_eq!((c.area, c.mean, c.at_border), (120.0, [14.5, 12.5], false));
        let book = [400.0 / 12.0, 0.0, 36.0 / 12.0];
        assert!(c.moments.iter().zip(book).all(|(a, b)| (a - b).abs() < 1e-9), "{:?}", c.moments);
        // Area over π·2σ₁·2σ₂ of a rectangle is 3/π.
        assert!((c.ellipse_fill() - 3.0 / std::f64::consts::PI).abs() < 1e-9);
    }
}
