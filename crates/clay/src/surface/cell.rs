//! A cell between eight voxel centres: which of its crossings belong to one loop, and where the loop has its vertex.
//!
//! Corners are numbered with x fastest, then y, then z. Edges are numbered by their axis, then by where the edge lies
//! along the next axis and the one after it, in cyclic order: [`edge_number`].

use crate::field::SOLID;

use super::MARGIN;

/// Corners of a cell that are clay, a bit for each.
pub(super) type Corners = u8;

/// Edges of a cell.
const EDGES: usize = 12;
/// Faces of a cell: low and high along x, then y, then z.
pub(super) const FACES: usize = 6;
/// Loops that a cell can have.
pub(super) const MOST_LOOPS: usize = 4;
/// Of an edge that the surface does not cross.
const NO_LOOP: u8 = u8::MAX;
const HALF: f32 = SOLID as f32 / 2.0;

/// To which loop each edge of a cell belongs.
#[derive(Clone, Copy)]
pub(super) struct Loops {
    of_edge: [u8; EDGES],
    /// The edges of each loop: bits.
    edges: [u16; MOST_LOOPS],
    count: u8,
}

/// What the signs of a cell's corners say about it.
pub(super) struct Configuration {
    /// The loops, when each segment cuts off clay.
    clay_apart: Loops,
    /// A face with two segments that are in one loop then. A cell has one such face at most, and no other face with
    /// four crossings beside it, so what is decided on it concerns no other face.
    pinched: Option<u8>,
    /// The loops, when the segments on that face cut off air.
    air_apart: Loops,
}

static CONFIGURATIONS: [Configuration; 256] = {
    let mut all = [const { Configuration::of(0) }; 256];
    let mut corners = 0;
    while corners < 256 {
        all[corners] = Configuration::of(corners as Corners);
        corners += 1;
    }
    all
};

impl Configuration {
    /// What the signs of these corners say.
    pub(super) fn at(corners: Corners) -> &'static Self {
        &CONFIGURATIONS[usize::from(corners)]
    }

    /// The face, if there is one, on which cutting off clay puts two segments into one loop. If the cell on the other
    /// side of the face says the same, air is cut off there.
    pub(super) const fn pinched(&self) -> Option<u8> {
        self.pinched
    }

    /// The loops where each segment cuts off clay.
    pub(super) const fn clay_apart(&self) -> &Loops {
        &self.clay_apart
    }

    /// The loops where the segments on the pinched face cut off air.
    pub(super) const fn air_apart(&self) -> &Loops {
        &self.air_apart
    }

    const fn of(corners: Corners) -> Self {
        let clay_apart = Loops::of(corners, None);
        let mut pinched = None;
        let mut face = 0;
        while face < FACES {
            let [a, b, c, d] = edges_around(face);
            let one = clay_apart.of_edge[a];
            if one != NO_LOOP
                && clay_apart.of_edge[b] == one
                && clay_apart.of_edge[c] == one
                && clay_apart.of_edge[d] == one
            {
                pinched = Some(face as u8);
            }
            face += 1;
        }
        Self {
            clay_apart,
            pinched,
            air_apart: Loops::of(corners, pinched),
        }
    }
}

impl Loops {
    /// Joins the crossings on each face. With four of them the segments cut off clay; on `air_apart` they cut off air.
    const fn of(corners: Corners, air_apart: Option<u8>) -> Self {
        let mut of_edge = [NO_LOOP; EDGES];
        let mut edge = 0;
        while edge < EDGES {
            let (start, end) = ends(edge);
            if is_clay(corners, start) != is_clay(corners, end) {
                of_edge[edge] = edge as u8;
            }
            edge += 1;
        }
        let mut face = 0;
        while face < FACES {
            let around = corners_around(face);
            let edges = edges_around(face);
            let cuts_off_air = match air_apart {
                Some(chosen) => chosen as usize == face,
                None => false,
            };
            let mut crossings = 0;
            let mut side = 0;
            while side < 4 {
                if of_edge[edges[side]] != NO_LOOP {
                    crossings += 1;
                }
                side += 1;
            }
            let mut corner = 0;
            while corner < 4 {
                let (before, after) = (edges[(corner + 3) % 4], edges[corner]);
                let cut_off = is_clay(corners, around[corner]) != cuts_off_air;
                if crossings == 4 && cut_off {
                    join(&mut of_edge, before, after);
                }
                // With two crossings, each is joined to the next one around the face.
                let mut next = corner + 1;
                while crossings == 2 && next < 4 {
                    if of_edge[after] != NO_LOOP && of_edge[edges[next]] != NO_LOOP {
                        join(&mut of_edge, after, edges[next]);
                    }
                    next += 1;
                }
                corner += 1;
            }
            face += 1;
        }
        let count = number_from_zero(&mut of_edge);
        let mut edges = [0; MOST_LOOPS];
        let mut edge = 0;
        while edge < EDGES {
            if of_edge[edge] != NO_LOOP {
                edges[of_edge[edge] as usize] |= 1 << edge;
            }
            edge += 1;
        }
        Self {
            of_edge,
            edges,
            count,
        }
    }

    /// The loop through a crossing.
    pub(super) const fn through(&self, edge: usize) -> u8 {
        self.of_edge[edge]
    }

    fn edges(&self, number: u8) -> impl Iterator<Item = usize> {
        let mut left = self.edges[usize::from(number)];
        std::iter::from_fn(move || {
            let edge = (left != 0).then(|| left.trailing_zeros() as usize)?;
            left &= left - 1;
            Some(edge)
        })
    }
}

/// Puts two edges, with all that are in their loops, into one loop.
const fn join(of_edge: &mut [u8; EDGES], one: usize, other: usize) {
    let (keep, give_up) = (of_edge[one], of_edge[other]);
    let mut edge = 0;
    while edge < EDGES {
        if of_edge[edge] == give_up {
            of_edge[edge] = keep;
        }
        edge += 1;
    }
}

/// Numbers loops 0, 1, …; returns how many there are.
const fn number_from_zero(of_edge: &mut [u8; EDGES]) -> u8 {
    let old = *of_edge;
    let mut count = 0;
    let mut edge = 0;
    while edge < EDGES {
        if old[edge] != NO_LOOP {
            let mut first = 0;
            while old[first] != old[edge] {
                first += 1;
            }
            if first == edge {
                of_edge[edge] = count;
                count += 1;
            } else {
                of_edge[edge] = of_edge[first];
            }
        }
        edge += 1;
    }
    count
}

/// The number of the edge along an axis that lies low (0) or high (1) along the next axis and the one after it.
pub(super) const fn edge_number(axis: usize, along_next: usize, along_last: usize) -> usize {
    4 * axis + along_next + 2 * along_last
}

/// The corners that an edge leads from and to, the lower one first.
const fn ends(edge: usize) -> (usize, usize) {
    let axis = edge / 4;
    let start = (edge & 1) << ((axis + 1) % 3) | (edge >> 1 & 1) << ((axis + 2) % 3);
    (start, start | 1 << axis)
}

/// The corners of a face, one after the other around it.
const fn corners_around(face: usize) -> [usize; 4] {
    let axis = face / 2;
    let (next, last) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
    let low = (face & 1) << axis;
    [low, low | next, low | next | last, low | last]
}

/// The edges of a face: each from the corner of its place in [`corners_around`] to the next one.
const fn edges_around(face: usize) -> [usize; 4] {
    let axis = face / 2;
    let (next, last, side) = ((axis + 1) % 3, (axis + 2) % 3, face & 1);
    // From the axis `next` the following ones are `last` and `axis`, from `last` they are `axis` and `next`.
    [
        edge_number(next, 0, side),
        edge_number(last, side, 1),
        edge_number(next, 1, side),
        edge_number(last, side, 0),
    ]
}

const fn is_clay(corners: Corners, corner: usize) -> bool {
    corners >> corner & 1 == 1
}

/// The vertex of a loop, and where it may go.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vertex {
    /// The cell's lowest corner, a voxel of the grid; -1 is the air before it.
    pub(super) cell: [i16; 3],
    /// Axes along which it stays in the lower half of its cell, and in the upper half: bits.
    lower_half: u8,
    upper_half: u8,
    /// Its place in the cell, from 0 to 1 along each axis, before any shift.
    within: [f32; 3],
    /// Out of the clay, of unit length; zero where the loop faces all ways alike.
    outward: [f32; 3],
}

impl Vertex {
    /// The vertex of a loop of a cell with these occupancies at its corners.
    pub(super) fn new(
        cell: [i16; 3],
        occupancies: &[u8; 8],
        corners: Corners,
        loops: &Loops,
        number: u8,
    ) -> Self {
        let (mut sum, mut count, mut outward) = ([0.0_f32; 3], 0.0_f32, [0.0_f32; 3]);
        for edge in loops.edges(number) {
            let (start, end) = ends(edge);
            let axis = edge / 4;
            let clay_first = is_clay(corners, start);
            let along = if clay_first {
                reach(occupancies[start], occupancies[end])
            } else {
                1.0 - reach(occupancies[end], occupancies[start])
            };
            for (at, total) in sum.iter_mut().enumerate() {
                *total += if at == axis {
                    along
                } else {
                    (start >> at & 1) as f32
                };
            }
            outward[axis] += if clay_first { 1.0 } else { -1.0 };
            count += 1.0;
        }
        let crisp = occupancies.iter().all(|&o| o == 0 || o == SOLID);
        let within = if crisp {
            [0.5; 3]
        } else {
            sum.map(|total| total / count)
        };
        let length = outward.iter().map(|o| o * o).sum::<f32>().sqrt().max(1.0);
        let (lower_half, upper_half) = halves(corners, loops, number);
        Self {
            cell,
            lower_half,
            upper_half,
            within,
            outward: outward.map(|o| o / length),
        }
    }

    /// Its place in the cell, from 0 to 1 along each axis, when it is shifted outwards by so many voxels.
    pub(super) fn within(&self, shift: f32) -> [f32; 3] {
        std::array::from_fn(|axis| {
            let lowest = if self.upper_half >> axis & 1 == 1 {
                0.5 + MARGIN
            } else {
                MARGIN
            };
            let highest = if self.lower_half >> axis & 1 == 1 {
                0.5 - MARGIN
            } else {
                1.0 - MARGIN
            };
            // Not `clamp`, which says in numbers what is wrong with its bounds: a browser would load all that writes
            // them. These are in order.
            (self.within[axis] + shift * self.outward[axis])
                .max(lowest)
                .min(highest)
        })
    }
}

/// How far clay reaches from the centre of a voxel that counts as clay towards that of one that counts as air, from 0
/// to 1.
///
/// Where occupancy drops by half or more, the two voxels are taken to be filled from one side: what they hold reaches
/// from the first one's beginning, half a voxel before its centre. This is exact for planes whose slopes against the
/// axis add up to one at most. Where occupancy drops by less, the plane is steeper; occupancy is then linear between
/// the centres, and the plane is where it passes half. At a drop of one half both agree.
fn reach(clay: u8, air: u8) -> f32 {
    let (clay, air) = (f32::from(clay), f32::from(air));
    let drop = clay - air;
    let along = if HALF <= drop {
        (clay + air - HALF) / f32::from(SOLID)
    } else {
        (clay - HALF) / drop
    };
    // Below zero if clay that is less than half of solid counts.
    along.clamp(0.0, 1.0)
}

/// Axes along which a loop stays in the lower and in the upper half of its cell, so that no two loops of a cell meet. A
/// loop cuts some corners off from others; it stays where all the fewer of them are, and if these lie on either side
/// along every axis, where most of them are.
fn halves(corners: Corners, loops: &Loops, number: u8) -> (u8, u8) {
    if loops.count == 1 {
        return (0, 0);
    }
    let (mut clay, mut air) = (0_u8, 0_u8);
    for edge in loops.edges(number) {
        let (start, end) = ends(edge);
        for corner in [start, end] {
            if is_clay(corners, corner) {
                clay |= 1 << corner;
            } else {
                air |= 1 << corner;
            }
        }
    }
    let fewer = if clay.count_ones() <= air.count_ones() {
        clay
    } else {
        air
    };
    let axes_with = |most_astray: u32| {
        let axes = |astray: [u8; 3]| -> u8 {
            (0..3)
                .filter(|&axis| (fewer & astray[axis]).count_ones() <= most_astray)
                .map(|axis| 1 << axis)
                .sum()
        };
        (axes(HIGH), axes(HIGH.map(|high| !high)))
    };
    match axes_with(0) {
        (0, 0) => axes_with((fewer.count_ones() - 1) / 2),
        all => all,
    }
}

/// Corners that are high along each axis.
const HIGH: [u8; 3] = [0b1010_1010, 0b1100_1100, 0b1111_0000];

#[cfg(test)]
mod tests {
    use super::*;

    fn four_crossings(corners: Corners, face: usize) -> bool {
        let [a, b, c, d] = corners_around(face).map(|corner| is_clay(corners, corner));
        a == c && b == d && a != b
    }

    #[test]
    fn edges_lie_between_the_corners_of_their_faces() {
        for face in 0..FACES {
            let (corners, edges) = (corners_around(face), edges_around(face));
            for side in 0..4 {
                let (start, end) = ends(edges[side]);
                let (one, other) = (corners[side], corners[(side + 1) % 4]);
                assert_eq!((start, end), (one.min(other), one.max(other)));
                assert!(
                    corners
                        .iter()
                        .all(|corner| corner >> (face / 2) & 1 == face & 1)
                );
            }
        }
    }

    /// What the proof rests on: a pinched face is the only one with four crossings, and cutting off air there parts the
    /// loop.
    #[test]
    fn a_pinched_cell_has_one_face_to_decide_and_deciding_parts_its_loop() {
        let mut pinched = 0;
        for corners in 0..=Corners::MAX {
            let configuration = Configuration::at(corners);
            let faces: Vec<_> = (0..FACES)
                .filter(|&face| four_crossings(corners, face))
                .collect();
            let twice: Vec<_> = faces
                .iter()
                .copied()
                .filter(|&face| {
                    let [a, b, c, d] =
                        edges_around(face).map(|edge| configuration.clay_apart.through(edge));
                    a == b && b == c && c == d
                })
                .collect();
            let Some(face) = configuration.pinched() else {
                assert!(twice.is_empty());
                continue;
            };
            pinched += 1;
            assert_eq!((&faces, &twice), (&vec![usize::from(face)], &faces));
            assert_eq!(configuration.clay_apart.count, 1);
            assert_eq!(configuration.air_apart.count, 2);
            let [a, b, c, d] =
                edges_around(usize::from(face)).map(|edge| configuration.air_apart.through(edge));
            assert!((a == b) != (b == c) && (a == b) == (c == d));
        }
        // Air in two corners across a face, twice six of these; or beside these in the corner opposite to either.
        assert_eq!(pinched, 12 + 24);
    }

    #[test]
    fn loops_of_one_cell_stay_in_different_halves() {
        let mut pairs = 0;
        for corners in 0..=Corners::MAX {
            let configuration = Configuration::at(corners);
            for loops in [configuration.clay_apart(), configuration.air_apart()] {
                for one in 0..loops.count {
                    for other in 0..one {
                        let (low, high) = halves(corners, loops, one);
                        let (other_low, other_high) = halves(corners, loops, other);
                        assert!(low & other_high | high & other_low != 0, "{corners:08b}");
                        pairs += 1;
                    }
                }
            }
        }
        assert!(100 < pairs, "{pairs}");
    }

    /// A plane has known shares in the voxels on an axis that it crosses: the crossing is found where it is.
    #[test]
    fn a_plane_is_crossed_where_it_is() {
        for (slope, tolerance) in [
            (0.0, 0.005),
            (0.5, 0.005),
            (1.0, 0.005),
            (2.0, 0.03),
            (4.0, 0.03),
        ] {
            for place in 0..=20 {
                let place = f64::from(place) / 20.0;
                // Mean over the voxel's width of what lies below the plane, by its middle; voxels are centred on 0 and
                // 1.
                let occupancy = |centre: f64| {
                    let steps = 1000;
                    let share = (0..steps).map(|step| {
                        let across = (f64::from(step) + 0.5) / f64::from(steps) - 0.5;
                        (place + slope * across - centre + 0.5).clamp(0.0, 1.0)
                    });
                    (share.sum::<f64>() / f64::from(steps) * 255.0).round() as u8
                };
                let (clay, air) = (occupancy(0.0), occupancy(1.0));
                if clay <= 127 || 128 <= air {
                    continue;
                }
                let error = f64::from(reach(clay, air)) - place;
                assert!(
                    error.abs() < tolerance,
                    "slope {slope}, at {place}: {error}"
                );
            }
        }
    }
}
