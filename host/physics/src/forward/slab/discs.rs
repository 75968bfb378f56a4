//! Discs of contact on a slab: the system that they make, and how readings change where one of them is replaced.

use nalgebra::DMatrix;

use super::cut::CutDisc;
use super::disc::DiscBasis;
use super::pads::between;
use super::{Slab, from_corner};
use crate::forward::contact::{ContactSystem, Contacted};
use crate::forward::uneven_place::UnevenPlace;
use crate::forward::{DiscFields, ForwardError};
use crate::geometry::Point;
use crate::scene::Contact;

/// Degree of the densities that the kernel's changes are taken for.
const CHANGE_DEGREE: usize = 1;

/// Highest degree of a disc's own densities that its own kernel's changes are taken for, where it widens or sees its image.
const OWN_CHANGE_DEGREE: usize = 4;

/// Distance of a wall, in radii, up to which the image in it is near: further off, degree 1 has the changes to some per cent.
const WALL_RADII: f64 = 2.5;

/// A contact, ready to be put into the system.
struct Disc {
    contact: Contact,
    centre_m: [f64; 2],
    /// Of the part on the detector (S), and the radius of a whole disc of its area (m).
    conductance_s: f64,
    own_radius_m: f64,
    cut: Option<CutDisc>,
    basis: &'static DiscBasis,
    /// Means under the densities, of the electrodes' fields (ohm): `densities x electrodes`, and of the pads' correction (square root
    /// of ohm): `columns x densities`.
    electrodes_ohm: DMatrix<f64>,
    inner: DMatrix<f64>,
    uneven: Option<UnevenPlace>,
}

/// The kernels of a disc before it changes: with each of the discs, and its [own](Slab::own_kernel).
struct Before {
    first: Vec<FirstKernel>,
    own: DMatrix<f64>,
}

/// The kernel between the first points of two discs of an even slab (ohm), and its derivatives by the places of the first one's (ohm/m).
struct FirstKernel {
    even_ohm: DMatrix<f64>,
    slopes: [DMatrix<f64>; 2],
}

impl FirstKernel {
    /// The same where the first one's points are moved (m), or those of both where it is one disc.
    fn moved(&self, ways_m: &[[f64; 2]], same: bool) -> DMatrix<f64> {
        let by = |i: usize, j: usize| (0..2).map(|axis| self.slopes[axis][(i, j)] * ways_m[i][axis]).sum::<f64>();
        let change = |i: usize, j: usize| by(i, j) + if same { by(j, i) } else { 0.0 };
        let (rows, columns) = self.even_ohm.shape();
        DMatrix::from_fn(rows, columns, |i, j| self.even_ohm[(i, j)] + change(i, j))
    }
}

/// The kernel between the first densities of two discs, from that of their points on an even slab.
fn first_densities(points_ohm: &DMatrix<f64>, disc: &Disc, other: &Disc) -> DMatrix<f64> {
    let weights = DiscBasis::of_degree(CHANGE_DEGREE).weights();
    let mut kernel = weights * points_ohm * weights.transpose();
    on_uneven(&mut kernel, disc, other);
    kernel
}

impl Disc {
    fn first_nodes_m(&self) -> Vec<[f64; 2]> {
        nodes_m(DiscBasis::of_degree(CHANGE_DEGREE), self.centre_m, self.contact.radius_m, self.cut)
    }
}

/// Makes the kernel between densities of two discs on an even slab that of an uneven one.
fn on_uneven(kernel: &mut DMatrix<f64>, disc: &Disc, other: &Disc) {
    if let (Some(here), Some(there)) = (&disc.uneven, &other.uneven) {
        kernel[(0, 0)] += here.correction_ohm(there);
        *kernel *= here.inverse_root * there.inverse_root;
    }
}

/// A point, and the current into it for each electrode.
pub(super) type PointCurrents = ([f64; 2], Vec<f64>);

/// Some discs, with the fields between them.
pub(super) struct Discs<'a> {
    slab: &'a Slab,
    discs: Vec<Disc>,
    /// Fields between the densities of two discs (ohm), without their own singular parts: lower triangle, row by row.
    between: Vec<DMatrix<f64>>,
    /// Of each, the matrix of its resistance and its own singular field, times its conductance.
    own: Vec<DMatrix<f64>>,
}

impl Slab {
    /// The discs of contacts.
    ///
    /// # Errors
    /// [`ForwardError::Contact`] if one cannot be on this detector.
    pub(super) fn discs(&self, contacts: &[Contact]) -> Result<Discs<'_>, ForwardError> {
        let disc = |(index, contact): (usize, &Contact)| {
            self.check_contact(contact).map_err(|what| ForwardError::Contact { index, what })?;
            Ok(self.disc(contact, DiscBasis::of_degree(self.contact_degree(contact.radius_m))))
        };
        let discs = contacts.iter().enumerate().map(disc).collect::<Result<Vec<_>, _>>()?;
        let pairs = discs.iter().enumerate().flat_map(|(k, disc)| discs[..=k].iter().map(move |other| (disc, other)));
        let between = pairs.map(|(disc, other)| self.between(disc, other)).collect();
        let own = discs.iter().map(|disc| self.own(disc)).collect();
        Ok(Discs { slab: self, discs, between, own })
    }

    /// The impedance matrix (ohm), and points from the corner (m) that stand for the contacts, with the current into each for 1 A into each
    /// electrode.
    pub(super) fn currents_on_top(
        &self,
        contacts: &[Contact],
    ) -> Result<(DMatrix<f64>, Vec<PointCurrents>), ForwardError> {
        let discs = self.discs(contacts)?;
        let at = Solved::new(&discs)?;
        let mut points = Vec::new();
        for (k, disc) in discs.discs.iter().enumerate() {
            let currents = disc.basis.weights().tr_mul(&at.of(k)) * disc.conductance_s.sqrt();
            let nodes = nodes_m(disc.basis, disc.centre_m, disc.contact.radius_m, disc.cut);
            points.extend(nodes.into_iter().zip(currents.row_iter().map(|row| row.iter().copied().collect())));
        }
        Ok((at.contacted.impedance_ohm, points))
    }

    /// Fields of an even current over a disc.
    pub(super) fn fields_of_disc(&self, [x_m, y_m]: Point, radius_m: f64) -> Result<DiscFields, ForwardError> {
        let contact = Contact::flat(x_m, y_m, radius_m, 1.0);
        self.check_contact(&contact).map_err(|what| ForwardError::Contact { index: 0, what })?;
        let degree = self.contact_degree(radius_m).min(self.resolution.even_degree);
        let disc = self.disc(&contact, DiscBasis::of_degree(degree));
        let even = disc.uneven.as_ref().map_or(1.0, |uneven| uneven.inverse_root.powi(2));
        let own_ohm = even * self.top.even_disc_ohm(disc.own_radius_m) + self.between(&disc, &disc)[(0, 0)];
        let electrodes_ohm = disc.electrodes_ohm.row(0).iter().copied().collect();
        // The conductance given is one.
        Ok(DiscFields::centred(electrodes_ohm, own_ohm, disc.conductance_s))
    }

    fn disc(&self, contact: &Contact, basis: &'static DiscBasis) -> Disc {
        let centre_m = from_corner(self.size_m, [contact.x_m, contact.y_m]);
        let cut = CutDisc::new(self.size_m, centre_m, contact.radius_m);
        let share = cut.map_or(1.0, |cut| cut.share());
        let [electrodes_ohm, inner] = self.pads.under_disc(basis, &nodes_m(basis, centre_m, contact.radius_m, cut));
        Disc {
            contact: *contact,
            centre_m,
            conductance_s: share * contact.conductance_s,
            own_radius_m: share.sqrt() * contact.radius_m,
            cut,
            basis,
            electrodes_ohm,
            inner,
            uneven: self.uneven.as_ref().map(|uneven| uneven.place(centre_m)),
        }
    }

    /// The smooth part of the kernel varies over a split length: a disc that is wider needs more degrees.
    fn contact_degree(&self, radius_m: f64) -> usize {
        let wider = (radius_m / self.top.split_m() - 1.0).max(0.0);
        (self.resolution.contact_degree + (2.0 * wider).ceil() as usize).min(self.resolution.most_degree)
    }

    /// Fields between the densities of two discs, or of one, without its own singular part (ohm). The floating pads below are a short
    /// way for the current between contacts.
    fn between(&self, disc: &Disc, other: &Disc) -> DMatrix<f64> {
        let mut all = -disc.inner.tr_mul(&other.inner);
        // Of contacts far apart, only the first densities see each other.
        let distance_m = (disc.centre_m[0] - other.centre_m[0]).hypot(disc.centre_m[1] - other.centre_m[1]);
        let degrees = match std::ptr::eq(disc, other) {
            true => [disc, other].map(|disc| disc.basis.degree()),
            false => [disc, other].map(|disc| disc.basis.degree_seen_from(disc.contact.radius_m / distance_m)),
        };
        let kernel = self.kernel_between(disc, other, degrees);
        let mut near = all.view_mut((0, 0), kernel.shape());
        near += kernel;
        all
    }

    /// The kernel's part of that, for densities up to some degrees.
    fn kernel_between(&self, disc: &Disc, other: &Disc, degrees: [usize; 2]) -> DMatrix<f64> {
        let [radius_m, other_m] = [disc, other].map(|disc| disc.contact.radius_m);
        let images = self.top.images(disc.centre_m, other.centre_m, radius_m + other_m);
        let of = |disc: &Disc, degree: usize| {
            let basis = DiscBasis::of_degree(degree);
            (basis, nodes_m(basis, disc.centre_m, disc.contact.radius_m, disc.cut))
        };
        let (basis, nodes) = of(disc, degrees[0]);
        let mut kernel = if std::ptr::eq(disc, other) {
            between(basis, &nodes, basis, &nodes, &self.top, &images, true)
        } else {
            let (other_basis, other_nodes) = of(other, degrees[1]);
            between(basis, &nodes, other_basis, &other_nodes, &self.top, &images, false)
        };
        on_uneven(&mut kernel, disc, other);
        kernel
    }

    /// The first densities' part of it, which has all but a per cent of how it changes with the disc.
    fn first_between(&self, disc: &Disc, other: &Disc) -> FirstKernel {
        let nodes = [disc, other].map(Disc::first_nodes_m);
        let images = self.top.images(disc.centre_m, other.centre_m, disc.contact.radius_m + other.contact.radius_m);
        let same = std::ptr::eq(disc, other);
        let mut all = [(); 3].map(|()| DMatrix::zeros(nodes[0].len(), nodes[1].len()));
        for (i, a) in nodes[0].iter().enumerate() {
            for (j, b) in nodes[1].iter().enumerate() {
                let of = self.top.with_slopes(&images, same, *a, *b);
                all.iter_mut().zip(of).for_each(|(matrix, value)| matrix[(i, j)] = value);
            }
        }
        let [even_ohm, by_x, by_y] = all;
        FirstKernel { even_ohm, slopes: [by_x, by_y] }
    }

    /// The kernel of a disc with itself, for those densities that have most of how it changes.
    fn own_kernel(&self, disc: &Disc) -> DMatrix<f64> {
        self.kernel_between(disc, disc, [disc.basis.degree().min(OWN_CHANGE_DEGREE); 2])
    }

    /// Whether a disc is so near to a wall that its image there bends its densities.
    fn is_at_wall(&self, disc: &Disc) -> bool {
        let near_m = WALL_RADII * disc.contact.radius_m;
        (0..2).any(|axis| disc.centre_m[axis].min(self.size_m[axis] - disc.centre_m[axis]) < near_m)
    }

    fn own(&self, disc: &Disc) -> DMatrix<f64> {
        self.own_with(disc, disc.conductance_s)
    }

    fn own_with(&self, disc: &Disc, conductance_s: f64) -> DMatrix<f64> {
        let even = disc.uneven.as_ref().map_or(1.0, |uneven| uneven.inverse_root.powi(2));
        self.top.disc_self(disc.own_radius_m).reduced(disc.basis, 1.0, even * conductance_s)
    }
}

impl Discs<'_> {
    /// The impedance matrix; `None` if none conducts.
    pub fn impedance_ohm(&self) -> Option<DMatrix<f64>> {
        self.system().impedance_ohm()
    }

    /// The impedance matrix, and to first order by how much it changes (ohm) where one of the contacts is replaced by another.
    ///
    /// With the system `S y = -b` of all discs and `Z = E + b^T y`, a change of the discs changes `Z` by
    /// `dZ = db^T y + y^T db + y^T dS y`, in which only rows and columns of the disc that is replaced are not zero.
    ///
    /// # Errors
    /// [`ForwardError`] if a contact cannot be on the detector or none conducts.
    pub fn with_changes_ohm(
        &self,
        replaced: &[(usize, Contact)],
    ) -> Result<(DMatrix<f64>, Vec<DMatrix<f64>>), ForwardError> {
        let at = Solved::new(self)?;
        let mut before: Vec<Option<Before>> = (0..self.discs.len()).map(|_| None).collect();
        let changes = replaced.iter().map(|(k, contact)| {
            self.slab.check_contact(contact).map_err(|what| ForwardError::Contact { index: *k, what })?;
            let disc = &self.discs[*k];
            let unscaled = Contact { conductance_s: disc.contact.conductance_s, ..*contact };
            if unscaled == disc.contact {
                return Ok(self.change_of_conductance_ohm(&at, *k, contact));
            }
            let before = before[*k].get_or_insert_with(|| self.before(disc));
            Ok(self.change_of_place_ohm(&at, *k, contact, before))
        });
        let changes = changes.collect::<Result<_, _>>()?;
        Ok((at.contacted.impedance_ohm, changes))
    }

    fn before(&self, disc: &Disc) -> Before {
        Before {
            first: self.discs.iter().map(|other| self.slab.first_between(disc, other)).collect(),
            own: self.slab.own_kernel(disc),
        }
    }

    fn change_of_conductance_ohm(&self, at: &Solved, k: usize, contact: &Contact) -> DMatrix<f64> {
        let disc = &self.discs[k];
        let factor = contact.conductance_s / disc.contact.conductance_s;
        let own = self.slab.own_with(disc, factor * disc.conductance_s);
        at.symmetric(k, self.scaled(at, k, factor) + (own - &self.own[k]) * at.of(k) * 0.5)
    }

    fn change_of_place_ohm(&self, at: &Solved, k: usize, contact: &Contact, before: &Before) -> DMatrix<f64> {
        let disc = &self.discs[k];
        let after = self.slab.disc(contact, disc.basis);
        let scale = after.conductance_s.sqrt();
        let mut change = (&after.electrodes_ohm - &disc.electrodes_ohm) * scale;
        change += (&disc.inner - &after.inner).tr_mul(&at.inner) * scale;
        let ways_m: Vec<_> = after
            .first_nodes_m()
            .into_iter()
            .zip(disc.first_nodes_m())
            .map(|(to, from)| [to[0] - from[0], to[1] - from[1]])
            .collect();
        for (l, (other, first)) in self.discs.iter().zip(&before.first).enumerate() {
            let (now, half) = if l == k { (&after, 0.5) } else { (other, 1.0) };
            let moved = if l == k && (after.contact.radius_m != disc.contact.radius_m || self.slab.is_at_wall(disc)) {
                // Within a disc that widens, or sees its own image, all densities change.
                self.slab.own_kernel(&after) - &before.own
            } else {
                first_densities(&first.moved(&ways_m, l == k), &after, now)
                    - first_densities(&first.even_ohm, disc, other)
            };
            let scales = half * scale * now.conductance_s.sqrt();
            let mut first = change.rows_mut(0, moved.nrows());
            first += &moved * at.of(l).rows(0, moved.ncols()) * scales;
        }
        if after.conductance_s != disc.conductance_s {
            change += self.scaled(at, k, after.conductance_s / disc.conductance_s);
        }
        if (after.conductance_s, after.own_radius_m) != (disc.conductance_s, disc.own_radius_m) {
            change += (self.slab.own(&after) - &self.own[k]) * at.of(k) * 0.5;
        }
        at.symmetric(k, change)
    }

    /// What a factor of the conductance of a disc makes of its rows but for its own resistance: the unknowns' scale is its root, and by
    /// the system itself the fields of all unknowns at the disc are what the electrodes' and the constant are, with the other sign.
    fn scaled(&self, at: &Solved, k: usize, factor: f64) -> DMatrix<f64> {
        -(&self.own[k] * at.of(k)) * (factor.sqrt() - 1.0)
    }

    fn system(&self) -> ContactSystem<'_> {
        let electrodes = self.slab.pads.electrodes();
        let size = self.discs.iter().map(|disc| disc.basis.len()).sum();
        let mut contacts = DMatrix::zeros(size, size);
        let mut cross_and_current = DMatrix::zeros(electrodes + 1, size);
        let mut row = 0;
        for (k, disc) in self.discs.iter().enumerate() {
            let scale = disc.conductance_s.sqrt();
            cross_and_current[(electrodes, row)] = scale;
            let cross = disc.electrodes_ohm.transpose() * scale;
            cross_and_current.view_mut((0, row), cross.shape()).copy_from(&cross);
            let mut column = 0;
            for (l, other) in self.discs[..=k].iter().enumerate() {
                let block = &self.between[k * (k + 1) / 2 + l] * (scale * other.conductance_s.sqrt());
                contacts.view_mut((row, column), block.shape()).copy_from(&block);
                column += other.basis.len();
            }
            let mut own = contacts.view_mut((row, row), self.own[k].shape());
            own += &self.own[k];
            row += disc.basis.len();
        }
        let electrodes = &self.slab.pads.electrodes_ohm;
        ContactSystem { electrodes, contacts, cross_and_current, leak_s: self.slab.driving.leak_s }
    }
}

/// A solved system.
struct Solved {
    contacted: Contacted,
    /// First unknown of each disc, and the number of all.
    starts: Vec<usize>,
    /// Correction of the pads by all unknowns, scaled: `columns x electrodes`.
    inner: DMatrix<f64>,
}

impl Solved {
    fn new(discs: &Discs<'_>) -> Result<Self, ForwardError> {
        let contacted = discs.system().solve().ok_or(ForwardError::NoContact)?;
        let mut starts = vec![0];
        for disc in &discs.discs {
            starts.push(starts.last().map_or(0, |start| start + disc.basis.len()));
        }
        let mut at = Self { contacted, starts, inner: DMatrix::zeros(0, 0) };
        let sum = discs.discs.iter().enumerate().map(|(k, disc)| &disc.inner * at.of(k) * disc.conductance_s.sqrt());
        at.inner = sum.reduce(|sum, other| sum + other).ok_or(ForwardError::NoContact)?;
        Ok(at)
    }

    /// The unknowns of a disc: `densities x electrodes`.
    fn of(&self, k: usize) -> MatrixView<'_> {
        self.contacted.unknowns.rows(self.starts[k], self.starts[k + 1] - self.starts[k])
    }

    /// Change of the impedances by one of a disc's rows.
    fn symmetric(&self, k: usize, change: DMatrix<f64>) -> DMatrix<f64> {
        let half = self.of(k).tr_mul(&change);
        &half + half.transpose()
    }
}

type MatrixView<'a> = nalgebra::DMatrixView<'a, f64, nalgebra::U1, nalgebra::Dyn>;

/// The points of a basis on a disc, or on what walls leave of it (m).
fn nodes_m(basis: &DiscBasis, centre_m: [f64; 2], radius_m: f64, cut: Option<CutDisc>) -> Vec<[f64; 2]> {
    match cut {
        Some(cut) => basis.mapped_nodes_m(centre_m, radius_m, |node| cut.map(node)),
        None => basis.nodes_m(centre_m, radius_m),
    }
}
