"""What holds for all tests: of a test that loops over models, methods or cases, the longest runs
take part only when slow tests run, and every kind keeps one that is quick. Modules are compiled
without optimisation, which is most of the compiler's time; with it where the compiled code itself
is looked at, and in all tests on request."""

import gc
from collections.abc import Iterator

import pytest

from tests.compilation import unoptimised

LONG = {
    "": ("waveboard",),
    "test_each_is_a_mechanical_system": (
        *("tracked_chain", "delta_robot", "stewart", "forty_four_bars", "balancing_robot"),
        *("ballbot", "quadrotor", "wishbones", "scissor", "governor", "ball_on_plate"),
    ),
    "test_each_figure_is_that_of_its_model": (
        *("tracked_chain", "delta_robot", "stewart", "forty_four_bars", "balancing_robot"),
        *("ballbot", "quadrotor", "scissor", "cable", "ball_in_bowl", "wheel_on_road", "trailer"),
        *("crane", "trebuchet", "rocket", "hoist", "bungee", "braking", "muscle", "hydraulic"),
        *("dropped", "dc_motor", "cam", "rolling_resistance"),
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
        "change_point",
        *("isosceles_slider", "mass_ratio", "near_parallel", "scale_metre"),
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
    "test_order_is_nominal": (
        "four_bar-quasi_velocities-tangent",
        "four_bar-quasi_velocities-none",
        "four_bar-quasi_velocities-selective",
        "four_bar-quasi_velocities-partitioning",
        "four_bar-augmented-none",
        "four_bar-augmented-projection",
        "four_bar-augmented-partitioning",
        "four_bar-augmented-selective",
        "four_bar-augmented-tangent",
        "ellipsoid",
        "rolling_disk",
        "cart",
        "double_pendulum",
    ),
    "test_extreme_models": (
        *(
            "bicycle_toroidal",
            "bricard",
            "four_bar_chain",
            "isosceles_slider",
            "long_run",
            "scale_micrometre",
            "heavy_top",
            "gimbal",
            "tumbling",
        ),
        *("third_crank", "scale_metre", "straight_snake"),
        "change_point",
    ),
    "test_published_digits": ("andrews", "car_axis", "pendulum-options5", "pendulum-options6"),
    "test_wrong_terms_of_the_system_are_caught": (
        *("four_bar", "snake3", "rolling_disk", "bead_in_bowl"),
    ),
    "test_no_pivot_of_an_accepted_choice_vanishes_at_the_initial_state": (
        "rolling_disk",
        "rolling_sphere",
        "slider_crank",
        "bicycle",
        "rolling_torus",
        "mobile_manipulator",
        "hoop",
        "tractor_trailers",
        *("andrews", "spatial_four_bar", "snake3", "universal_shaft"),
    ),
    "test_momenta_that_nothing_changes_are_found_and_their_change_is_caught": (
        *("tumbling", "heavy_top"),
    ),
    "test_a_closure_of_every_kind_passes": ("0", "5"),
    "test_partitions_that_may_fail_together_are_followed_by_the_orthonormal_choice": ("rnd19",),
    "test_what_is_nothing_but_rounding_is_not_compared_with_itself": ("leaning disk", "screw"),
    "test_no_double_in_any_enforcement_or_integrator": ("four_bar",),
    "test_loops_give_what_straight_code_gives": (
        "text0",
        "text1",
    ),
    "test_every_planted_error_is_caught": ("free_body", "bead_on_wire", "rolling_disk"),
    "test_simulation": ("rosenbrock", "implicit_midpoint"),
    "test_other_widths_give_the_same_rows": ("8",),
    "test_rounding_stays_small": ("stanford_arm", "snake3", "four_bar"),
    "test_trees_need_no_more_than_their_graph": ("chain of 30",),
    "test_four_bar_stays_closed_and_in_balance": ("best",),
    "test_planted_errors_are_caught_at_every_scale": (
        "tiny",
        "enormous",
    ),
    "test_what_is_printed_is_what_is_compiled": (
        "snake3-udwadia",
        "snake3-augmented",
        "snakeboard",
        "slider_crank",
        "four_bar-rocker",
        "four_bar-udwadia",
        "four_bar-tangent",
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
    "test_the_verdict_does_not_depend_on_the_units": (
        "rolling_disk-slow",
        "rolling_disk-light",
        "rolling_disk-tiny",
        "slider_crank",
        "four_bar",
    ),
    "test_mechanisms": ("augmented-spatial_four_bar", "round_2"),
    "test_one_chart_where_a_choice_is_safe_or_named": ("bicycle",),
    "test_linkages_that_can_be_laid_flat": ("kite", "rhombus"),
    "test_the_motion_does_not_depend_on_how_it_is_formed": (
        "rolling_disk",
        "snake3-quasi_velocities-best",
        "rolling_sphere",
        "gear_train",
        "snakeboard-quasi_velocities-best",
        "slider_crank-quasi_velocities-best",
        "rolling_torus",
        "hoop",
        "universal_shaft",
        "mass_orthogonal",
        "tractor_trailers-quasi_velocities-best",
        "spatial_four_bar",
        "andrews",
        "mobile",
        "bicycle",
    ),
    "test_charts_are_shown_with_their_guards_and_the_way_between": ("snakeboard",),
    "test_four_bars_in_a_row": ("20", "10"),
    "test_every_choice_passes_the_suite": (
        "keep-twice",
        "keep-in_space",
        "drop-twice",
        "drop-in_space",
    ),
    "test_a_model_without_freedom_is_built_and_verified": ("ball",),
    "test_energies_that_are_not_quadratic_are_in_balance": ("magnet",),
    "test_any_number_of_products_and_any_order": ("17",),
    "test_chaplygin_sleigh_is_its_closed_form": ("best",),
    "test_block_inverse": (
        "mobile_manipulator_2r",
        "snakeboard",
        "rolling_sphere",
        "rolling_disk",
        "tractor_trailers",
        "bicycle",
        "andrews",
        "rolling_torus",
        "hoop",
        "mobile_manipulator_6r",
        "universal_shaft",
        "spatial_four_bar",
    ),
    "test_an_entry_that_is_wrong_by_a_thousandth_is_seen_in_every_function": (
        "bicycle",
        "ball",
    ),
    "test_a_wheel_away_from_the_origin_of_a_body_with_an_arm": (
        "best-",
        "constants1",
    ),
    "test_every_sequence_of_angles_rolls_as_the_reference_does": (
        "yxz",
        "zyz",
        "yzx",
        "yxy",
        "xzy",
        "xyx",
        "yzy",
        "xzx",
        "zxy",
    ),
    "test_rows_of_every_length_have_lanes": (
        "50",
        "52",
        "56",
    ),
    "test_motion_and_forces_are_those_of_the_reference_under_both_policies": (
        "in_space",
        "bricard",
    ),
    "test_second_derivatives_are_slopes_of_the_first": ("delta_robot",),
    "test_derivatives_are_slopes_of_dynamics": ("delta_robot",),
    "test_every_check_looks_and_is_green": ("bicycle",),
    "test_a_row_goes_through_flat_positions_as_one_pendulum": ("crank",),
    "test_what_arrives_is_right": ("crank",),
    "test_lanes_and_numpy_go_the_same_way": ("crank",),
    "test_deviations_count_what_the_filter_leaves_from_row_to_row": (
        "12.0",
        "16.0",
    ),
    "test_the_suite_sees_a_wrong_closure_row": (
        "screw",
        "planar",
        "cylindrical",
        "universal",
    ),
    "test_every_closure": (
        "screw",
        "planar",
        "cylindrical",
        "universal",
    ),
    "test_every_closure_to_the_ground": (
        "screw",
        "planar",
        "cylindrical",
        "universal",
    ),
    "test_sound_motions_are_green": ("four_bar",),
    "test_all_ways_of_writing_a_contact_say_the_same": ("bicycle",),
    "test_what_a_python_package_carries_is_checked": (
        "jax",
        "numba",
    ),
    "test_wrong_products_of_derivatives_are_caught": ("dynamics_hessian",),
    "test_rows_are_those_of_one_motion": (
        *("velocities", "rolling", "fed_back", "stabilised", "parameters", "frame", "snake"),
    ),
    "test_every_road_prints_what_is_compiled_and_comes_to_the_same_equations": ("bead_on_wire",),
    "test_the_unreduced_equations_agree_and_have_their_spurious_zeros": ("bicycle",),
    "test_a_speed_that_every_motion_has_as_zero_is_refused_by_name": ("45",),
}

# several seconds each, of kinds that others of their file hold in less
SLOW = frozenset(
    {
        "test_rows",
        "test_a_wrong_reference_is_noticed",
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
        "test_estimates_stand_beside_the_errors",
        "test_what_breaks_and_what_does_not_fit_is_said",
        "test_files",
        "test_page",
        "test_nothing_is_computed_twice",
        "test_a_joint_load_and_enforcement_are_simulated",
        "test_the_smallest_hinge_meets_what_users_try_first",
        "test_the_waveboard_is_never_self_stable_as_given",
        "test_a_board_with_unlike_ends_falls_more_slowly",
        "test_a_constant_off_by_a_millionth_is_seen_in_the_shipped_module",
        "test_functions_that_grow_are_left_out_by_name",
        "test_a_start_from_rest_is_no_error",
        "test_hostile_text_stays_text",
        "test_folder_moves_and_falls_back",
        "test_long_functions_name_their_files_and_their_stack",
        "test_slots_are_used_again",
        "test_a_slip_in_a_model_file",
        "test_a_prescribed_motion_starts_consistent_at_its_start",
        "test_time_does_not_stand_still",
        "test_a_stiff_damper_takes_the_implicit_step",
        "test_one_text_names_several_as_on_the_command_line",
        "test_every_operation_has_the_series_of_many_digits",
        "test_standard_parameters_do_not_mind_states",
        "test_commands_say_how_the_motion_was_made",
        "test_pivots_of_a_band_are_found_without_looking_at_all_of_it",
        "test_not_every_rank_of_many_rows_is_tried",
        "test_few_links_are_rolled_where_that_takes_no_more_operations",
        "test_the_page_of_a_bicycle_gives_its_verdict_in_one_line",
        "test_what_the_default_choice_cannot_finish_its_charts_do",
        "test_derivatives_of_a_step_are_slopes_of_the_step",
        "test_memory_grows_as_the_loops_do",
        "test_a_function_alone_brings_what_keeps_the_frame_of_its_chart",
        "test_values_that_had_to_give_way_are_counted_with_rows_and_without",
        "test_errors_are_planted_in_functions_on_request_and_seen",
        "test_long_rows_are_crossed_too",
        "test_the_orthonormal_choice_of_a_row_grows_with_its_length",
        "test_code_that_is_wrong_without_optimisation_is_caught",
        "test_the_first_rows_tell_the_shortest_way_of_writing_all",
    }
)


def pytest_configure() -> None:
    # what thousands of tests keep is looked through for cycles again and again
    gc.freeze()
    gc.set_threshold(200_000, 20, 100)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--optimised", action="store_true", help="compile as builds do, in all tests")


@pytest.fixture(autouse=True, scope="module")
def _compiled(request: pytest.FixtureRequest) -> Iterator[None]:
    if request.config.getoption("--optimised") or request.node.get_closest_marker("optimised"):
        yield
        return
    with unoptimised():
        yield


def pytest_collection_modifyitems(items):
    for item in items:
        test, _, run = item.name.partition("[")
        parts = (*LONG[""], *LONG.get(test, ()))
        if test in SLOW or any(part in run for part in parts):
            item.add_marker(pytest.mark.slow)
