//! How much circuit each model takes: a table of all, and five of them beside the circuit that an engineer draws by hand.

use crate::translated::{models, translated};
use bondspice::bond::elaborate::Overrides;
use bondspice::translate::Figures;
use std::collections::BTreeSet;

/// A circuit drawn by hand: what its model is, how much it takes, and its netlist without values. 0 V meters are its
/// helpers.
struct Drawn {
    model: &'static str,
    figures: Figures,
    netlist: &'static str,
}

const BY_HAND: &[Drawn] = &[
    Drawn {
        model: "eha_one_line.bg",
        figures: Figures { nodes: 27, devices: 40, helpers: 1 },
        // Figs. 14 and 15 of the paper, with one equivalent line: the loss of the line is a law of its flow, which nothing
        // else carries.
        netlist: "
            * bus, chopper, armature
            V_bus bus 0
            G_chopper bus 0 {v(alpha)*i(E_chopper)}
            E_chopper a1 0 {v(alpha)*v(bus)}
            R_eta a1 a2
            R_arm a2 a3
            L_arm a3 a4
            H_emf a4 0 E_pump
            * shaft
            H_torque s1 0 E_chopper
            L_Jmp s1 s2
            R_fmp s2 s3
            R_fetam s3 s4
            E_pump s4 0 p1 0
            * oil
            F_pump 0 p1 E_pump
            R_Clp p1 0
            V_meter p1 p2
            B_loss p2 p3 {law(i(V_meter))}
            C_fluid p3 p4
            R_dilatation p4 0
            F_piston 0 p3 E_piston
            * rod
            E_piston r1 0 p3 0
            L_Mj r1 r2
            B_dry r2 r3 {law(i(E_piston))}
            F_lever 0 r3 E_lever
            C_stiffness r3 r4
            R_Cmj r4 0
            * surface
            V_aero t1 0
            E_lever t2 t1 r3 0
            L_J t2 0
            * regulators
            V_ref x_ref 0
            F_x 0 x E_piston
            C_x x 0
            F_theta 0 theta V_aero
            C_theta theta 0
            B_omega omega_ref 0
            B_iz 0 iz
            C_iz iz 0
            B_i i_ref 0
            B_az 0 az
            C_az az 0
            B_alpha alpha 0
        ",
    },
    Drawn {
        model: "rlc_bridge.bg",
        figures: Figures { nodes: 4, devices: 7, helpers: 0 },
        netlist: "
            V a 0
            R1 a b
            C b 0
            R5 b c
            L a d
            RL d c
            R4 c 0
        ",
    },
    Drawn {
        model: "two_tank.bg",
        figures: Figures { nodes: 3, devices: 6, helpers: 1 },
        // The inflow is to be plotted, and no simulator keeps the current of a current source: a meter.
        netlist: "
            I_in 0 pipe
            V_meter pipe first
            C_T1 first 0
            B_R12 first second {law(v(first,second))}
            C_T2 second 0
            B_R2 second 0 {law(v(second))}
        ",
    },
    Drawn {
        model: "dc_motor_load.bg",
        figures: Figures { nodes: 10, devices: 14, helpers: 0 },
        netlist: "
            V_supply a1 0
            L_arm a1 a2
            R_arm a2 a3
            H_emf a3 0 E_gear
            H_torque r1 0 V_supply
            L_Jm r1 r2
            R_bm r2 r3
            E_gear r3 0 s 0
            F_gear 0 s E_gear
            C_shaft s k
            R_shaft k 0
            V_load l s
            L_Jl l m
            R_bl m 0
        ",
    },
    Drawn {
        model: "buck.bg",
        figures: Figures { nodes: 6, devices: 9, helpers: 0 },
        netlist: "
            V_in in 0
            B_in in 0 {v(d)*i(B_cell)}
            B_cell s 0 {v(d)*v(in)}
            L s x
            R_L x out
            R_load out 0
            R_esr out c
            C c 0
            V_duty d 0
        ",
    },
];

fn count(netlist: &str) -> Figures {
    let cards = netlist.lines().map(str::trim);
    let cards: Vec<Vec<&str>> = cards
        .filter(|line| !line.is_empty() && !line.starts_with('*'))
        .map(|line| line.split_whitespace().collect())
        .collect();
    let nodes: BTreeSet<&str> =
        cards.iter().flat_map(|card| card[1..3].to_vec()).filter(|node| *node != "0").collect();
    let meters = cards.iter().filter(|card| card[0].starts_with("V_meter")).count();
    Figures { nodes: nodes.len(), devices: cards.len(), helpers: meters }
}

#[test]
fn no_more_circuit_than_by_hand() {
    for Drawn { model, figures, netlist } in BY_HAND {
        assert_eq!(count(netlist), *figures, "{model}");
        let ours = translated(std::path::Path::new(model), &Overrides::default());
        let ours = ours.translation.figures;
        assert!(
            ours.nodes <= figures.nodes
                && ours.devices <= figures.devices
                && ours.helpers <= figures.helpers,
            "{model}: {ours}, by hand {figures}"
        );
    }
}

#[test]
fn figures_of_all_models() {
    let rows = models().into_iter().map(|model| {
        let figures = translated(&model, &Overrides::default()).translation.figures;
        format!("{:<32} {figures}\n", model.display().to_string())
    });
    insta::assert_snapshot!(rows.collect::<String>());
}
