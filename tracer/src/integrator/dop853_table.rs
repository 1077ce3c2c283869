//! Coefficients of Dormand and Prince's 8(5,3).
//!
//! Source: Hairer, Nørsett and Wanner, *Solving Ordinary Differential Equations I* (2nd edition, 1993), section II.5 and
//! the authors' program dop853.f. Mistyped copies are about; these are tested against every order condition.

#![allow(clippy::excessive_precision)] // as printed in the source

/// One stage: its node and the weights of the derivatives before it.
pub(crate) struct Stage {
    /// Part of the step.
    pub c: f64,
    /// Stage and weight.
    pub a: &'static [(usize, f64)],
}

/// Stages 1 to 11 (stage 0 is the start of the step), then 13 to 15 for the dense output; stage 12 is the end of the step.
pub(crate) const STAGES: [Stage; 14] = [
    Stage { c: 0.0526001519587677318785587544488, a: &[(0, 0.0526001519587677318785587544488)] },
    Stage {
        c: 0.0789002279381515978178381316732,
        a: &[(0, 0.0197250569845378994544595329183), (1, 0.0591751709536136983633785987549)],
    },
    Stage {
        c: 0.118350341907227396726757197510,
        a: &[(0, 0.0295875854768068491816892993775), (2, 0.0887627564304205475450678981324)],
    },
    Stage {
        c: 0.281649658092772603273242802490,
        a: &[
            (0, 0.241365134159266685502369798665),
            (2, -0.884549479328286085344864962717),
            (3, 0.924834003261792003115737966543),
        ],
    },
    Stage {
        c: 1.0 / 3.0,
        a: &[
            (0, 0.037037037037037037037037037037),
            (3, 0.170828608729473871279604482173),
            (4, 0.125467687566822425016691814123),
        ],
    },
    Stage {
        c: 0.25,
        a: &[
            (0, 0.037109375),
            (3, 0.170252211019544039314978060272),
            (4, 0.0602165389804559606850219397283),
            (5, -0.017578125),
        ],
    },
    Stage {
        c: 4.0 / 13.0,
        a: &[
            (0, 0.0370920001185047927108779319836),
            (3, 0.170383925712239993810214054705),
            (4, 0.107262030446373284651809199168),
            (5, -0.0153194377486244017527936158236),
            (6, 8.27378916381402288758473766e-3),
        ],
    },
    Stage {
        c: 0.651282051282051282051282051282,
        a: &[
            (0, 0.624110958716075717114429577812),
            (3, -3.36089262944694129406857109825),
            (4, -0.868219346841726006818189891453),
            (5, 27.5920996994467083049415600797),
            (6, 20.1540675504778934086186788979),
            (7, -43.4898841810699588477366255144),
        ],
    },
    Stage {
        c: 0.6,
        a: &[
            (0, 0.477662536438264365890433908527),
            (3, -2.48811461997166764192642586468),
            (4, -0.590290826836842996371446475743),
            (5, 21.2300514481811942347288949897),
            (6, 15.2792336328824235832596922938),
            (7, -33.2882109689848629194453265587),
            (8, -0.0203312017085086261358222928593),
        ],
    },
    Stage {
        c: 0.857142857142857142857142857142,
        a: &[
            (0, -0.93714243008598732571704021658),
            (3, 5.18637242884406370830023853209),
            (4, 1.09143734899672957818500254654),
            (5, -8.14978701074692612513997267357),
            (6, -18.5200656599969598641566180701),
            (7, 22.7394870993505042818970056734),
            (8, 2.49360555267965238987089396762),
            (9, -3.0467644718982195003823669022),
        ],
    },
    Stage {
        c: 1.0,
        a: &[
            (0, 2.27331014751653820792359768449),
            (3, -10.5344954667372501984066689879),
            (4, -2.00087205822486249909675718444),
            (5, -17.9589318631187989172765950534),
            (6, 27.9488845294199600508499808837),
            (7, -2.85899827713502369474065508674),
            (8, -8.87285693353062954433549289258),
            (9, 12.3605671757943030647266201528),
            (10, 0.643392746015763530355970484046),
        ],
    },
    Stage {
        c: 0.1,
        a: &[
            (0, 0.0561675022830479523392909219681),
            (6, 0.253500210216624811088794765333),
            (7, -0.246239037470802489917441475441),
            (8, -0.124191423263816360469010140626),
            (9, 0.15329179827876569731206322685),
            (10, 8.201052295634689884916666021e-3),
            (11, 7.567897660545699761386035896e-3),
            (12, -8.298e-3),
        ],
    },
    Stage {
        c: 0.2,
        a: &[
            (0, 0.0318346481635021405060768473261),
            (5, 0.0283009096723667755288322961402),
            (6, 0.0535419883074385676223797384372),
            (7, -0.0549237485713909884646569340306),
            (10, -1.08347328697249322858509317e-4),
            (11, 3.825710908356584129549201923e-4),
            (12, -3.404650086874045608029771145e-4),
            (13, 0.141312443674632500278074618366),
        ],
    },
    Stage {
        c: 7.0 / 9.0,
        a: &[
            (0, -0.428896301583791923408573538692),
            (5, -4.69762141536116384314449447206),
            (6, 7.68342119606259904184240953878),
            (7, 4.06898981839711007970213554331),
            (8, 0.356727187455281109270669543021),
            (12, -1.399024165159014621294180097e-3),
            (13, 2.9475147891527723389556272149),
            (14, -9.15095847217987001081870187138),
        ],
    },
];

/// Weights of the solution of order 8.
pub(crate) const SOLUTION: &[(usize, f64)] = &[
    (0, 0.0542937341165687622380535766363),
    (5, 4.45031289275240888144113950566),
    (6, 1.89151789931450038304281599044),
    (7, -5.8012039600105847814672114227),
    (8, 0.31116436695781989440891606237),
    (9, -0.152160949662516078556178806805),
    (10, 0.201365400804030348374776537501),
    (11, 0.0447106157277725905176885569043),
];

/// Weights of the error of the embedded solution of order 5.
pub(crate) const ERROR_5: &[(usize, f64)] = &[
    (0, 0.01312004499419488073250102996),
    (5, -1.225156446376204440720569753),
    (6, -0.4957589496572501915214079952),
    (7, 1.664377182454986536961530415),
    (8, -0.3503288487499736816886487290),
    (9, 0.3341791187130174790297318841),
    (10, 0.08192320648511571246570742613),
    (11, -0.02235530786388629525884427845),
];

/// Weights of the embedded solution of order 3.
pub(crate) const SOLUTION_3: &[(usize, f64)] = &[
    (0, 0.244094488188976377952755905512),
    (8, 0.733846688281611857341361741547),
    (11, 0.0220588235294117647058823529412),
];

/// Weights of the last four terms of the dense output.
pub(crate) const DENSE: [&[(usize, f64)]; 4] = [
    &[
        (0, -8.4289382761090128651353491142),
        (5, 0.56671495351937776962531783590),
        (6, -3.0689499459498916912797304727),
        (7, 2.3846676565120698287728149680),
        (8, 2.1170345824450282767155149946),
        (9, -0.87139158377797299206789907490),
        (10, 2.2404374302607882758541771650),
        (11, 0.63157877876946881815570249290),
        (12, -0.088990336451333310820698117400),
        (13, 18.148505520854727256656404962),
        (14, -9.1946323924783554000451984436),
        (15, -4.4360363875948939664310572000),
    ],
    &[
        (0, 10.427508642579134603413151009),
        (5, 242.28349177525818288430175319),
        (6, 165.20045171727028198505394887),
        (7, -374.54675472269020279518312152),
        (8, -22.113666853125306036270938578),
        (9, 7.7334326684722638389603898808),
        (10, -30.674084731089398182061213626),
        (11, -9.3321305264302278729567221706),
        (12, 15.697238121770843886131091075),
        (13, -31.139403219565177677282850411),
        (14, -9.3529243588444783865713862664),
        (15, 35.816841486394083752465898540),
    ],
    &[
        (0, 19.985053242002433820987653617),
        (5, -387.03730874935176555105901742),
        (6, -189.17813819516756882830838328),
        (7, 527.80815920542364900561016686),
        (8, -11.573902539959630126141871134),
        (9, 6.8812326946963000169666922661),
        (10, -1.0006050966910838403183860980),
        (11, 0.77771377980534432092869265740),
        (12, -2.7782057523535084065932004339),
        (13, -60.196695231264120758267380846),
        (14, 84.320405506677161018159903784),
        (15, 11.992291136182789328035130030),
    ],
    &[
        (0, -25.693933462703749003312586129),
        (5, -154.18974869023643374053993627),
        (6, -231.52937917604549567536039109),
        (7, 357.63911791061412378285349910),
        (8, 93.405324183624310003907691704),
        (9, -37.458323136451633156875139351),
        (10, 104.09964950896230045147246184),
        (11, 29.840293426660503123344363579),
        (12, -43.533456590011143754432175058),
        (13, 96.324553959188282948394950600),
        (14, -39.177261675615439165231486172),
        (15, -149.72683625798562581422125276),
    ],
];

#[cfg(test)]
mod tests {
    use super::*;

    /// A rooted tree, as the list of the trees on its root.
    #[derive(Clone)]
    struct Tree {
        branches: Vec<Tree>,
    }

    impl Tree {
        fn nodes(&self) -> usize {
            1 + self.branches.iter().map(Tree::nodes).sum::<usize>()
        }

        /// γ(t): the product over all nodes of the size of the tree above it.
        fn density(&self) -> f64 {
            self.nodes() as f64 * self.branches.iter().map(Tree::density).product::<f64>()
        }

        /// Φ_i(t) for every stage.
        fn weights(&self) -> Vec<f64> {
            let mut product = vec![1.0; 16];
            for branch in &self.branches {
                let inner = branch.weights();
                for (stage, p) in product.iter_mut().enumerate() {
                    *p *= row(stage).iter().map(|&(j, a)| a * inner[j]).sum::<f64>();
                }
            }
            product
        }
    }

    fn row(stage: usize) -> &'static [(usize, f64)] {
        match stage {
            0 => &[],
            1..=11 => STAGES[stage - 1].a,
            12 => SOLUTION,
            _ => STAGES[stage - 2].a,
        }
    }

    /// All rooted trees of up to `most` nodes, by number of nodes.
    fn trees(most: usize) -> Vec<Vec<Tree>> {
        /// Forests of `nodes` nodes whose trees come in order, none before `from` (nodes, index).
        fn forests(all: &[Vec<Tree>], nodes: usize, from: (usize, usize)) -> Vec<Vec<Tree>> {
            if nodes == 0 {
                return vec![Vec::new()];
            }
            let mut found = Vec::new();
            for size in from.0..=nodes.min(all.len() - 1) {
                for (index, tree) in all[size].iter().enumerate() {
                    if size == from.0 && index < from.1 {
                        continue;
                    }
                    for mut rest in forests(all, nodes - size, (size, index)) {
                        rest.push(tree.clone());
                        found.push(rest);
                    }
                }
            }
            found
        }
        let mut all: Vec<Vec<Tree>> = vec![Vec::new()];
        for nodes in 1..=most {
            let next = forests(&all, nodes - 1, (1, 0)).into_iter().map(|branches| Tree { branches }).collect();
            all.push(next);
        }
        all
    }

    #[test]
    fn nodes_are_the_sums_of_their_rows() {
        for stage in (1..12).chain(13..16) {
            let sum: f64 = row(stage).iter().map(|(_, a)| a).sum();
            let c = STAGES[if stage < 12 { stage - 1 } else { stage - 2 }].c;
            // Weights of size 40 in double precision.
            assert!((sum - c).abs() < 2e-14, "stage {stage}: {sum} {c}");
        }
    }

    #[test]
    fn every_order_condition_holds() {
        let all = trees(8);
        let counts: Vec<usize> = all.iter().map(Vec::len).collect();
        assert_eq!(counts, [0, 1, 1, 2, 4, 9, 20, 48, 115], "Cayley's numbers of rooted trees");
        let sum = |weights: &[(usize, f64)], phi: &[f64]| weights.iter().map(|&(i, b)| b * phi[i]).sum::<f64>();
        for (order, trees) in all.iter().enumerate() {
            for tree in trees {
                let (phi, exact) = (tree.weights(), 1.0 / tree.density());
                // Weights of size 40 meet sums of size one: some 1e-14.
                assert!((sum(SOLUTION, &phi) - exact).abs() < 1e-14, "order {order}");
                if order <= 5 {
                    assert!(sum(ERROR_5, &phi).abs() < 1e-14, "embedded order 5 at {order}");
                }
                if order <= 3 {
                    assert!((sum(SOLUTION_3, &phi) - exact).abs() < 1e-14, "embedded order 3 at {order}");
                }
            }
        }
        let worst = all[6].iter().map(|t| sum(ERROR_5, &t.weights()).abs()).fold(0.0, f64::max);
        assert!(worst > 1e-5, "the embedded solution must not be better than order 5: {worst}");
    }

    #[test]
    fn the_dense_output_has_order_seven() {
        // Weights of stage i at θ, from the nested form in which the program evaluates it.
        let weight = |i: usize, theta: f64| {
            let of = |list: &[(usize, f64)]| list.iter().find(|(j, _)| *j == i).map_or(0.0, |(_, w)| *w);
            let (b, first, last) = (of(SOLUTION), f64::from(i == 0), f64::from(i == 12));
            let mut value = 0.0;
            for (k, d) in DENSE.iter().enumerate().rev() {
                value = (value + of(d)) * if k % 2 == 1 { theta } else { 1.0 - theta };
            }
            value = (value + 2.0 * b - first - last) * theta;
            value = (value + first - b) * (1.0 - theta);
            (value + b) * theta
        };
        for (order, trees) in trees(7).iter().enumerate() {
            for tree in trees {
                let (phi, density) = (tree.weights(), tree.density());
                for theta in [0.25, 0.5, 0.9, 1.0_f64] {
                    let sum: f64 = (0..16).map(|i| weight(i, theta) * phi[i]).sum();
                    // Weights of size 500.
                    assert!((sum - theta.powi(order as i32) / density).abs() < 1e-12, "order {order} at {theta}");
                }
            }
        }
    }
}
