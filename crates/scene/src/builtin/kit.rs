//! A thing under construction: pieces of several materials, as finely made as the detail asks for.

use std::f32::consts::FRAC_PI_2;

use glam::{Affine3A, Quat, Vec2, Vec3};

use super::Detail;
use super::builder::{GlbBuilder, MaterialId, MeshId};
use super::profile::{block, rounded, turned, v2};
use super::shapes::{Geometry, cuboid, tube};

/// Pieces by material `S`, in the order in which materials are first used.
#[derive(Clone, Debug)]
pub(super) struct Kit<S> {
    pub(super) detail: Detail,
    pub(super) parts: Vec<(S, Geometry)>,
}

impl<S: Copy + PartialEq> Kit<S> {
    /// Nothing yet.
    pub(super) fn new(detail: Detail) -> Kit<S> {
        Kit { detail, parts: Vec::new() }
    }

    /// Whether the finest pieces are worth their triangles.
    pub(super) fn fine(&self) -> bool {
        self.detail.0 >= 0.4
    }

    /// Adds a piece.
    pub(super) fn add(&mut self, of: S, piece: &Geometry, placement: &Affine3A) {
        match self.parts.iter_mut().find(|(s, _)| *s == of) {
            Some((_, geometry)) => geometry.append(piece, placement),
            None => {
                let mut geometry = Geometry::new();
                geometry.append(piece, placement);
                self.parts.push((of, geometry));
            }
        }
    }

    /// Adds a piece, moved.
    pub(super) fn at(&mut self, of: S, piece: &Geometry, offset: Vec3) {
        self.add(of, piece, &Affine3A::from_translation(offset));
    }

    /// Adds all of another kit, placed.
    pub(super) fn all(&mut self, other: &Kit<S>, placement: &Affine3A) {
        for (of, piece) in &other.parts {
            self.add(*of, piece, placement);
        }
    }

    /// Adds all of another kit, moved.
    pub(super) fn at_all(&mut self, other: &Kit<S>, offset: Vec3) {
        self.all(other, &Affine3A::from_translation(offset));
    }

    /// A plain box between two corners.
    pub(super) fn plain(&mut self, of: S, a: [f32; 3], b: [f32; 3]) {
        self.at(of, &cuboid(Vec3::from(a), Vec3::from(b)), Vec3::ZERO);
    }

    /// A box with cut edges (at high detail) between two corners.
    pub(super) fn block(&mut self, of: S, a: [f32; 3], b: [f32; 3], bevel: f32) {
        self.at(of, &block(self.detail, Vec3::from(a), Vec3::from(b), bevel), Vec3::ZERO);
    }

    /// A round bar along points.
    pub(super) fn bar(&mut self, of: S, points: &[Vec3], radius: f32, sides: u32) {
        self.at(of, &tube(points, radius, self.detail.facets(sides, 3)), Vec3::ZERO);
    }

    /// A pipe along points whose corners are bent with a radius.
    pub(super) fn pipe(&mut self, of: S, points: &[Vec3], radius: f32, bend: f32, sides: u32) {
        let pieces = self.detail.facets(5, 2);
        self.bar(of, &bent(points, bend, pieces), radius, sides);
    }

    /// A turned piece, upright about a point.
    pub(super) fn turned(&mut self, of: S, at: Vec3, profile: &[[f32; 2]], segments: u32) {
        self.turned_along(of, at, Vec3::Y, profile, segments);
    }

    /// A turned piece about an axis.
    pub(super) fn turned_along(&mut self, of: S, at: Vec3, axis: Vec3, profile: &[[f32; 2]], segments: u32) {
        let profile: Vec<Vec2> = profile.iter().map(|&[r, y]| v2(r, y)).collect();
        let piece = turned(self.detail, &profile, self.detail.facets(segments, 5));
        let rotation = Quat::from_rotation_arc(Vec3::Y, axis.normalize_or(Vec3::Y));
        self.add(of, &piece, &Affine3A::from_rotation_translation(rotation, at));
    }

    /// A turned piece with a rounded outline.
    pub(super) fn round(&mut self, of: S, at: Vec3, profile: &[[f32; 2]], segments: u32) {
        let profile: Vec<Vec2> = profile.iter().map(|&[r, y]| v2(r, y)).collect();
        let profile = rounded(&profile, self.detail.facets(2, 2));
        let piece = turned(self.detail, &profile, self.detail.facets(segments, 5));
        self.at(of, &piece, at);
    }

    /// A disc's rim around a pipe: where two lengths of it are joined.
    pub(super) fn flange(&mut self, of: S, at: Vec3, axis: Vec3, radius: f32) {
        let half = 0.18 * radius;
        let rim = [[1.35 * radius, -half], [1.35 * radius, half]];
        self.turned_along(of, at, axis, &rim, 14);
    }

    /// The mesh of all pieces; `material` tells what each is made of.
    pub(super) fn mesh(&self, b: &mut GlbBuilder, name: &str, material: impl Fn(S) -> MaterialId) -> MeshId {
        let parts: Vec<(&Geometry, MaterialId)> =
            self.parts.iter().map(|(of, piece)| (piece, material(*of))).collect();
        b.mesh(name, &parts)
    }
}

/// A line with its corners rounded by arcs of a radius (less where the line is too short), `pieces` to each.
pub(super) fn bent(points: &[Vec3], radius: f32, pieces: u32) -> Vec<Vec3> {
    let mut out = Vec::new();
    for (i, &p) in points.iter().enumerate() {
        let (Some(&before), Some(&after)) = (i.checked_sub(1).and_then(|k| points.get(k)), points.get(i + 1))
        else {
            out.push(p);
            continue;
        };
        let (back, on) = ((before - p).normalize_or(Vec3::X), (after - p).normalize_or(Vec3::X));
        let room = 0.45 * before.distance(p).min(after.distance(p));
        // Half the angle that the line turns by.
        let half = 0.5 * libm::acosf((-back.dot(on)).clamp(-1.0, 1.0));
        if !(0.02..=0.98 * FRAC_PI_2).contains(&half) {
            out.push(p);
            continue;
        }
        let tangent = (radius * libm::tanf(half)).min(room);
        let (start, end) = (p + back * tangent, p + on * tangent);
        let r = tangent / libm::tanf(half);
        let middle = p + (back + on).normalize_or(Vec3::Y) * (r / libm::cosf(half));
        for k in 0..=pieces {
            let t = k as f32 / pieces.max(1) as f32;
            let angle = 2.0 * half * t;
            let (from, to) = (start - middle, end - middle);
            let weights = [libm::sinf(2.0 * half - angle), libm::sinf(angle)];
            out.push(middle + (from * weights[0] + to * weights[1]) / libm::sinf(2.0 * half));
        }
    }
    out
}
