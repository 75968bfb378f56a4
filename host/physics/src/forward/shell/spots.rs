//! Spots on a shell: discs of even current, cut by the edge, whose fields are tabulated at the mesh's nodes.
//!
//! At each node the means of the fields over a disc about it are exact for linear elements, and so are their derivatives by the
//! disc's place, edge included ([`Stencil`]). A mean over a disc is smooth on the scale of its radius, whatever the triangles, so
//! between nodes a cubic does: Bazeley, Cheung, Irons and Zienkiewicz's of values and slopes (1965).
//!
//! The field between two discs is a smooth, positive definite function of their places too. It is factorised at places that are
//! spread over the detector, about 1.4 radii apart (Nystrom's method): `N(x, y) = v(x) . v(y)`, and `v` is tabulated as the rest.
//! What lies between these places is left out of `N`: 1 to 2 % of a disc's own field, which is tabulated by itself.

use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix};

use super::Shell;
use super::contact::{cover, disc_m2, footing};
use super::locate::Locator;
use super::mesh::Mesh;
use crate::forward::ForwardError;
use crate::forward::spots::{MOST_PLACES, Spot, SpotFields, dot};
use crate::geometry::{Point, cross};
use crate::space::{self, Place};

/// Corners of the polygon that stands for a disc; it has the disc's area.
const CORNERS: usize = 24;
/// Places of the factorisation have an area of so many squared radii each; and there are no more of them than this, for a table
/// of 16 MB with 2000 nodes.
const FACTOR_AREA: f64 = 2.0;
const MOST_FACTORS: usize = 640;
/// Distance over which derivatives are taken, in radii.
const DIFFERENCE: f64 = 0.05;
/// Share of the mean of the diagonal that is added to it before it is factorised.
const RIDGE: f64 = 1e-7;
/// Nodes whose own fields are solved for at once.
const AT_ONCE: usize = 256;

/// The mean over a disc of a function that is linear in the triangles, as weights of nodes; and its derivatives by the disc's place.
struct Stencil {
    mean: Vec<(u32, f64)>,
    slopes: [Vec<(u32, f64)>; 2],
    /// Part of the disc that is on the detector, and its derivatives (1/m).
    share: [f64; 3],
}

/// Spots of a shell for one radius.
pub(super) struct SpotTable {
    mesh: Mesh,
    locator: Locator,
    electrodes: usize,
    columns: usize,
    /// At each node its values, then their derivatives along both tangents. Columns: electrodes (ohm), factor (square root of ohm),
    /// own field (ohm), share on the detector.
    rows: Vec<f32>,
    tangents: Vec<[Place; 2]>,
    /// Nodes, each as far as can be from those before it.
    spread: Vec<u32>,
}

/// Spots of a shell.
pub(super) struct ShellSpots(pub Arc<SpotTable>);

impl SpotTable {
    /// Tabulates the fields of discs of a radius (m).
    ///
    /// # Errors
    /// [`ForwardError::Detector`] if the shell's equations are singular.
    pub fn new(shell: &Shell, radius_m: f64) -> Result<Self, ForwardError> {
        let (mesh, locator) = (shell.mesh.clone(), shell.locator.clone());
        let nodes = mesh.nodes_m.len();
        let electrodes = shell.electrode_fields_ohm.ncols();
        let tangents = node_tangents(&mesh);
        let stencils: Vec<_> =
            (0..nodes).map(|node| Stencil::new(&mesh, &locator, node as u32, tangents[node], radius_m)).collect();
        let area_m2: f64 = shell.image_mesh.node_areas_m2.iter().sum();
        let wanted = (area_m2 / (FACTOR_AREA * radius_m * radius_m)) as usize;
        let spread = spread(&mesh, nodes.min(MOST_FACTORS.max(MOST_PLACES)));
        let factors = &spread[..wanted.clamp(1, spread.len().min(MOST_FACTORS))];
        let factor = factor_rows(shell, &stencils, factors)?;
        let own = own_rows(shell, &stencils)?;
        let columns = electrodes + factors.len() + 2;
        let mut rows = Vec::with_capacity(nodes * 3 * columns);
        for (node, stencil) in stencils.iter().enumerate() {
            for (part, own) in own[node].iter().enumerate() {
                let weights = stencil.weights(part);
                let field = |e: usize| weights.iter().map(|(i, w)| w * shell.fields_ohm[(*i as usize, e)]).sum::<f64>();
                rows.extend((0..electrodes).map(|e| field(e) as f32));
                rows.extend(factor.column(3 * node + part).iter().map(|value| *value as f32));
                rows.extend([*own as f32, stencil.share[part] as f32]);
            }
        }
        Ok(Self { mesh, locator, electrodes, columns, rows, tangents, spread })
    }

    /// All columns at a place of a triangle.
    fn sample(&self, triangle: u32, place_m: Place) -> Vec<f32> {
        let corners = self.mesh.triangles[triangle as usize];
        let (points, at, _) = self.mesh.seen_from(corners, place_m);
        let cubic = Cubic::new(points, at);
        let mut sums = vec![0.0_f32; self.columns];
        for i in 0..3 {
            let [first, second] = self.tangents[corners[i] as usize];
            let mut coefficients = [cubic.value[i], 0.0, 0.0];
            for (edge, j) in [(0, (i + 1) % 3), (1, (i + 2) % 3)] {
                let way = space::sub(self.mesh.place_m(corners[j]), self.mesh.place_m(corners[i]));
                coefficients[1] += cubic.slope[i][edge] * space::dot(way, first);
                coefficients[2] += cubic.slope[i][edge] * space::dot(way, second);
            }
            let start = corners[i] as usize * 3 * self.columns;
            let rows = self.rows[start..start + 3 * self.columns].chunks_exact(self.columns);
            for (row, coefficient) in rows.zip(coefficients) {
                let coefficient = coefficient as f32;
                sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += coefficient * value);
            }
        }
        sums
    }
}

impl SpotFields for ShellSpots {
    fn spot(&self, place_m: Place) -> Spot {
        let table = &*self.0;
        let foot = table.locator.nearest(&table.mesh, place_m);
        let mut sampled = table.sample(foot.triangle, foot.place_m);
        let mut last = || sampled.pop().map(f64::from).unwrap_or_default();
        let (share, own_ohm) = (last(), last());
        let inner = sampled.split_off(table.electrodes);
        Spot {
            place_m: foot.place_m,
            electrodes_ohm: sampled.into_iter().map(f64::from).collect(),
            own_ohm,
            // A cubic may overshoot by some per mille.
            share: share.clamp(1e-3, 1.0),
            inner,
            ..Spot::default()
        }
    }

    fn footing(&self, place_m: Place) -> (Place, [Place; 2]) {
        let foot = self.0.locator.nearest(&self.0.mesh, place_m);
        (foot.place_m, self.0.mesh.tangents(foot.triangle))
    }

    fn places_m(&self, count: usize) -> Vec<Place> {
        self.0.spread.iter().take(count).map(|node| self.0.mesh.place_m(*node)).collect()
    }

    fn between_ohm(&self, a: &Spot, b: &Spot) -> f64 {
        dot(&a.inner, &b.inner)
    }
}

impl Stencil {
    fn new(mesh: &Mesh, locator: &Locator, node: u32, tangents: [Place; 2], radius_m: f64) -> Self {
        let place_m = mesh.place_m(node);
        let covered = |place_m: Place| covered(mesh, locator, place_m, radius_m);
        let (mean, share) = covered(place_m);
        let step_m = DIFFERENCE * radius_m;
        let slope = |tangent: Place| {
            let [(after, share_after), (before, share_before)] =
                [step_m, -step_m].map(|step_m| covered(space::along(place_m, step_m, tangent)));
            let per_m = 0.5 / step_m;
            let all = after.into_iter().map(|(i, w)| (i, per_m * w));
            let all = all.chain(before.into_iter().map(|(i, w)| (i, -per_m * w))).collect();
            (merged(all), per_m * (share_after - share_before))
        };
        let [(first, share_first), (second, share_second)] = tangents.map(slope);
        Self { mean, slopes: [first, second], share: [share, share_first, share_second] }
    }

    /// Weights of the mean, or of a derivative.
    fn weights(&self, part: usize) -> &[(u32, f64)] {
        if part == 0 { &self.mean } else { &self.slopes[part - 1] }
    }
}

/// Weights of the mean over a disc about a place, and the part of it that is on the detector.
fn covered(mesh: &Mesh, locator: &Locator, place_m: Place, radius_m: f64) -> (Vec<(u32, f64)>, f64) {
    let mut all = Vec::new();
    if let Some(footing) = footing(mesh, locator, place_m, radius_m) {
        cover(mesh, locator, footing, (radius_m, CORNERS), |node, integral_m2| all.push((node, integral_m2)));
    }
    let area_m2: f64 = all.iter().map(|(_, integral_m2)| integral_m2).sum();
    all.iter_mut().for_each(|(_, weight)| *weight /= area_m2.max(f64::MIN_POSITIVE));
    (merged(all), area_m2 / disc_m2(radius_m, CORNERS))
}

/// One weight for each node.
fn merged(mut all: Vec<(u32, f64)>) -> Vec<(u32, f64)> {
    all.sort_unstable_by_key(|(node, _)| *node);
    all.dedup_by(|(node, weight), (kept, sum)| {
        let same = node == kept;
        if same {
            *sum += *weight;
        }
        same
    });
    all
}

/// Nodes, each as far as can be from those before it.
fn spread(mesh: &Mesh, count: usize) -> Vec<u32> {
    let mut away_m = vec![f64::INFINITY; mesh.nodes_m.len()];
    let mut chosen = vec![0u32];
    while chosen.len() < count {
        let last_m = mesh.place_m(chosen[chosen.len() - 1]);
        let mut farthest = (0, 0.0);
        for (node, away_m) in (0u32..).zip(&mut away_m) {
            *away_m = away_m.min(space::distance(mesh.place_m(node), last_m));
            if *away_m > farthest.1 {
                farthest = (node, *away_m);
            }
        }
        chosen.push(farthest.0);
    }
    chosen
}

/// `v` with `N(x, y) = v(x) . v(y)` between discs: a column for each node and part of its stencil.
fn factor_rows(shell: &Shell, stencils: &[Stencil], at: &[u32]) -> Result<DMatrix<f64>, ForwardError> {
    let fields_ohm = shell.floating_fields_ohm(at.len(), |j| stencils[at[j] as usize].mean.clone())?;
    // A node's fields beside each other.
    let fields_ohm = fields_ohm.transpose();
    let mut all = DMatrix::zeros(at.len(), 3 * stencils.len());
    for (node, stencil) in stencils.iter().enumerate() {
        for part in 0..3 {
            let mut column = all.column_mut(3 * node + part);
            for (i, weight) in stencil.weights(part) {
                column.axpy(*weight, &fields_ohm.column(*i as usize), 1.0);
            }
        }
    }
    let mut between = DMatrix::from_fn(at.len(), at.len(), |i, j| all[(i, 3 * at[j] as usize)]);
    let ridge_ohm = RIDGE * between.trace();
    (0..at.len()).for_each(|i| between[(i, i)] += ridge_ohm / at.len() as f64);
    let factor = Cholesky::new(between).ok_or_else(|| super::singular(&shell.detector))?;
    factor.l_dirty().solve_lower_triangular_mut(&mut all);
    Ok(all)
}

/// Each node's disc's own field (ohm), mean over the disc, and its derivatives (ohm/m).
fn own_rows(shell: &Shell, stencils: &[Stencil]) -> Result<Vec<[f64; 3]>, ForwardError> {
    let mut all = Vec::with_capacity(stencils.len());
    for some in stencils.chunks(AT_ONCE) {
        let fields_ohm = shell.floating_fields_ohm(some.len(), |j| some[j].mean.clone())?;
        all.extend(some.iter().enumerate().map(|(j, stencil)| {
            let field = fields_ohm.column(j);
            let along = |part: usize| stencil.weights(part).iter().map(|(i, w)| w * field[*i as usize]).sum::<f64>();
            [along(0), 2.0 * along(1), 2.0 * along(2)]
        }));
    }
    Ok(all)
}

/// Two unit vectors along the surface at each node.
fn node_tangents(mesh: &Mesh) -> Vec<[Place; 2]> {
    if mesh.places_m.is_empty() {
        return vec![[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]; mesh.nodes_m.len()];
    }
    let mut normals = vec![[0.0; 3]; mesh.nodes_m.len()];
    for triangle in &mesh.triangles {
        let normal = space::normal(triangle.map(|node| mesh.place_m(node)));
        for node in triangle {
            normals[*node as usize] = space::along(normals[*node as usize], 1.0, normal);
        }
    }
    let unit = |a: Place| space::along([0.0; 3], 1.0 / space::length(a).max(f64::MIN_POSITIVE), a);
    let tangents = |normal: Place| {
        let up = unit(normal);
        let aside = if up[0].abs() < 0.7 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
        let first = unit(space::cross(up, aside));
        [first, space::cross(up, first)]
    };
    normals.into_iter().map(tangents).collect()
}

/// Shape functions of Bazeley and others' triangle at a point.
struct Cubic {
    /// Of the value at each corner.
    value: [f64; 3],
    /// Of the derivatives at each corner by the ways to the next corner and to the one after it.
    slope: [[f64; 2]; 3],
}

impl Cubic {
    fn new([a, b, c]: [Point; 3], at: Point) -> Self {
        let twice_m2 = cross(a, b, c);
        // Barycentric coordinates.
        let l = [(b, c), (c, a), (a, b)].map(|(from, to)| cross(from, to, at) / twice_m2);
        let bubble = l[0] * l[1] * l[2];
        let value = l.map(|l| 3.0 * l * l - 2.0 * l * l * l + 2.0 * bubble);
        let slope = [0, 1, 2].map(|i| [l[(i + 1) % 3], l[(i + 2) % 3]].map(|to| l[i] * l[i] * to + 0.5 * bubble));
        Self { value, slope }
    }
}
