//! The closed form of a panel's potential and its gradient.

use meshes::Vec3;

use super::Panel;

impl Panel {
    /// ∫ dS / |x - y| over the panel, m, at the point x.
    ///
    /// As [`Panel::potential_and_gradient`].
    pub fn potential(&self, x: &Vec3) -> f64 {
        self.potential_and_gradient(x).0
    }

    /// ∫ dS / |x - y| over the panel, m, and its gradient with respect to x (a pure number).
    ///
    ///   φ  = Σ_i p_i f_i - d Ω,   ∇φ = -Σ_i m_i f_i - n Ω
    ///
    /// For each edge i: m_i its outward normal in the plane, p_i = m_i·(a_i - x) the distance of the edge's line, and
    /// f_i = ∫ dl / |x - y| along the edge = ln[(R₊ + R₋ + L)/(R₊ + R₋ - L)]; d = n·(x - a) the height of x above the
    /// plane, Ω the solid angle of the panel seen from x, with the sign of d.
    ///
    /// In the plane the gradient's normal part is the mean of both sides, zero; on an edge its part across the edge, which
    /// grows without bound there, is left out. Everywhere else the relative error is below 1e-12 as long as x is nearer than
    /// a thousand panel sizes (f_i cancel as distance over size).
    ///
    /// Source: Wilton et al. 1984, equations 5 and 6, with the solid angle of van Oosterom and Strackee 1983, equation 8.
    /// Checked by `exact_panel_integrals` and, against quadrature, by `closed_form_agrees_with_brute_force`.
    pub fn potential_and_gradient(&self, x: &Vec3) -> (f64, Vec3) {
        let n = &self.normal;
        let r = self.corners.map(|v| v - x);
        let length = r.map(|v| v.norm());
        let height = -n.dot(&r[0]);
        let mut potential = 0.0;
        let mut gradient = Vec3::zeros();
        for i in 0..3 {
            let j = (i + 1) % 3;
            let edge = r[j] - r[i];
            let edge_length = edge.norm();
            let along = edge / edge_length;
            let outward = along.cross(n);
            let distance = outward.dot(&r[i]);
            let (l_minus, l_plus) = (along.dot(&r[i]), along.dot(&r[j]));
            let line_squared = distance * distance + height * height;
            // R₊ + R₋ - L without cancellation: R ∓ l = line² / (R ± l) where l points away.
            let excess = if l_minus >= 0.0 {
                line_squared / (length[j] + l_plus) + (length[i] + l_minus)
            } else if l_plus <= 0.0 {
                line_squared / (length[i] - l_minus) + (length[j] - l_plus)
            } else {
                line_squared / (length[i] - l_minus) + line_squared / (length[j] + l_plus)
            };
            if excess > 0.0 {
                let f = (2.0 * edge_length / excess).ln_1p();
                potential += distance * f;
                gradient -= outward * f;
            }
        }
        let [a, b, c] = length;
        // The triple product r₀·(r₁×r₂) is minus the height times twice the area.
        let denominator = a * b * c + r[0].dot(&r[1]) * c + r[1].dot(&r[2]) * a + r[2].dot(&r[0]) * b;
        let solid_angle = if height == 0.0 { 0.0 } else { 2.0 * (2.0 * self.area * height).atan2(denominator) };
        (potential - height * solid_angle, gradient - n * solid_angle)
    }
}
