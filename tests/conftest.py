"""What holds for all tests: of a test that loops over models, methods or cases, the longest runs
take part only when slow tests run, and every kind keeps one that is quick."""

import pytest

LONG = {
    "": ("waveboard",),
    "test_each_is_a_mechanical_system": (
        *("tracked_chain", "delta_robot", "stewart", "forty_four_bars", "balancing_robot"),
        *("ballbot", "quadrotor", "wishbones", "scissor", "governor", "ball_on_plate"),
    ),
    "test_the_gallery_agrees_with_the_reference": (
        *("tracked_chain", "delta_robot", "stewart", "balancing_robot", "ballbot", "quadrotor"),
        *("wishbones", "scissor", "governor"),
    ),
    "test_every_example_is_a_model_with_a_consistent_state": ("rolling", "loops", "nut"),
    "test_models_need_no_more_than_their_graph": (
        "bicycle",
        "spatial_four_bar",
        "mobile_manipulator",
        "universal",
    ),
    "test_every_case_comes_out_as_its_file_expects": (
        *("change_point", "isosceles_slider", "mass_ratio", "near_parallel", "scale_metre"),
        *("straight_snake", "third_crank", "tumbling", "stiff_", "scale_micrometre"),
        "slow_drive",
    ),
    "test_every_choice_of_every_model_passes": (
        *("andrews", "bicycle", "car_axis", "chaplygin_sleigh", "double_pendulum", "gear_train"),
        *("mobile_manipulator", "pendulum", "planar_3r", "rolling_sphere", "rolling_torus"),
        *("slider_crank", "snakeboard", "spatial_four_bar", "universal_shaft", "tractor_trailers"),
        *("snake3", "screw_press", "stanford_arm"),
        "four_bar",
        "bead_on_wire",
        "hoop",
        "rolling_disk",
    ),
    "test_every_combination_agrees_or_is_refused": (
        *("ellipsoid", "rolling_disk", "four_bar-udwadia", "four_bar-maggi", "cart"),
        "double_pendulum",
    ),
    "test_ends_where_many_digits_end": ("four_bar", "double_pendulum"),
    "test_order_is_nominal": ("ellipsoid", "rolling_disk", "cart", "double_pendulum"),
    "test_extreme_models": (
        *("bicycle_toroidal", "bricard", "four_bar_chain", "isosceles_slider", "long_run"),
        *("third_crank", "scale_metre", "straight_snake"),
        "change_point",
    ),
    "test_published_digits": ("andrews", "car_axis", "pendulum-options5", "pendulum-options6"),
    "test_wrong_terms_of_the_system_are_caught": (
        *("four_bar", "snake3", "rolling_disk", "bead_in_bowl"),
    ),
    "test_no_pivot_of_an_accepted_choice_vanishes_at_the_initial_state": (
        *("andrews", "spatial_four_bar", "snake3", "universal_shaft"),
    ),
    "test_momenta_that_nothing_changes_are_found_and_their_change_is_caught": (
        *("tumbling", "heavy_top"),
    ),
    "test_a_closure_of_every_kind_passes": ("0", "5"),
    "test_partitions_that_may_fail_together_are_followed_by_the_orthonormal_choice": ("rnd19",),
    "test_what_is_nothing_but_rounding_is_not_compared_with_itself": ("leaning disk", "screw"),
    "test_no_double_in_any_enforcement_or_integrator": ("four_bar",),
    "test_loops_give_what_straight_code_gives": ("text1",),
    "test_every_planted_error_is_caught": (
        "free_body",
        "bead_on_wire",
        "rolling_disk",
    ),
    "test_simulation": ("rosenbrock", "implicit_midpoint"),
    "test_other_widths_give_the_same_rows": ("8",),
    "test_rounding_stays_small": ("stanford_arm", "snake3"),
    "test_trees_need_no_more_than_their_graph": ("chain of 30",),
    "test_four_bar_stays_closed_and_in_balance": ("best",),
    "test_planted_errors_are_caught_at_every_scale": (
        "tiny",
        "enormous",
    ),
    "test_what_is_printed_is_what_is_compiled": (
        "snake3-hinges",
        "snake3-maggi",
        "mobile",
        "best",
        "relative",
        "snake3-head-numbers",
        "lean_frame",
    ),
    "test_models_of_every_kind_pass": (
        "everything",
        "redundant-augmented",
    ),
    "test_the_verdict_does_not_depend_on_the_units": ("four_bar",),
    "test_mechanisms": ("augmented-spatial_four_bar", "round_2"),
    "test_one_chart_where_a_choice_is_safe_or_named": ("bicycle",),
    "test_linkages_that_can_be_laid_flat": ("kite", "rhombus"),
    "test_the_motion_does_not_depend_on_how_it_is_formed": (
        "spatial_four_bar",
        "andrews",
        "mobile",
        "bicycle",
    ),
    "test_charts_are_shown_with_their_guards_and_the_way_between": ("snakeboard",),
    "test_four_bars_in_a_row": ("20",),
}

# several seconds each, of kinds that others of their file hold in less
SLOW = frozenset(
    {
        "test_rows",
        "test_sizes_are_those_of_the_results",
        "test_a_stiff_motion_is_made_by_radau",
        "test_a_module_has_them_verified",
        "test_single_precision",
        "test_multipliers_of_a_library_are_none",
        "test_methods_vary_too",
        "test_the_regulator_holds_the_nonlinear_pole",
        "test_refuses_what_acts_at_every_stage",
        "test_a_motion_that_dwells_near_the_bound_does_not_chatter",
        "test_crank_and_rod_of_one_length",
        "test_a_wrong_requested_function_is_not_published",
        "test_functions_alone_have_their_charts",
        "test_a_wrong_end_is_seen",
        "test_a_wrong_loop_is_not_published",
        "test_many_steps_alone_are_not_stiff",
        "test_bounces_follow_the_energy_between_stops",
        "test_failed_verification_is_exit_code_4",
        "test_interrupted_build_leaves_nothing",
        "test_the_control_loop_reaches_its_heading",
        "test_every_wrong_sign_is_seen",
        "test_simulate_goes_through_and_says_so",
        "test_a_chain_of_ten_thousand_links_is_read",
        "test_a_loop_over_columns_gives_the_same",
        "test_two_charts_go_where_neither_goes_alone",
        "test_the_bicycle_is_stable_between_its_critical_speeds",
        "test_coefficients_of_the_snakeboard_are_the_textbooks",
        "test_motions_that_cannot_be_are_counted",
        "test_a_robot_afloat",
        "test_loops",
        "test_choices_are_drawn_along_the_motion",
        "test_momenta_are_held_where_they_are_conserved",
        "test_a_force_between_joints_keeps_the_unrolled_way_and_says_so",
        "test_directions_that_are_based_anew_are_verified_and_linearised",
        "test_command_line",
        "test_an_integrator_of_lower_order_is_caught",
        "test_energy_is_not_held_where_inputs_do_work",
        "test_stewart_platform_in_leg_speeds_keeps_its_digits",
        "test_the_section_lies_in_its_plane_at_one_energy",
        "test_float32_has_the_same_steps",
        "test_the_orthonormal_choice_goes_where_a_constant_frame_ends",
        "test_a_list_of_a_million_entries_is_refused_soon",
        "test_a_start_in_another_choice_is_a_switch",
        "test_a_closure_is_simulated",
        "test_every_changed_operation_of_the_motion_is_caught",
        "test_an_angle_of_many_turns_can_be_projected",
        "test_verify_says_which_parameters_it_varied",
        "test_what_comes_out_is_right_or_nothing_comes_out",
        "test_operations_and_text_grow_in_proportion",
        "test_every_way_of_integrating_comes_to_the_same_end",
        "test_a_motion_that_would_take_all_night_says_so",
        "test_a_stop_says_that_only_the_choice_is_singular",
        "test_one_error_turns_several_rungs_red",
        "test_shapes_and_batches_in_c_and_numpy",
        "test_what_the_reference_does_not_know_is_refused_with_a_sentence",
    }
)


def pytest_collection_modifyitems(items):
    for item in items:
        test, _, run = item.name.partition("[")
        parts = (*LONG[""], *LONG.get(test, ()))
        if test in SLOW or any(part in run for part in parts):
            item.add_marker(pytest.mark.slow)
