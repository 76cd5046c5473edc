"""What holds for all tests: of a test that loops over models, methods or cases, the longest runs
take part only when slow tests run, and every kind keeps one that is quick."""

import pytest

LONG = {
    "": ("waveboard",),
    "test_models_need_no_more_than_their_graph": ("bicycle",),
    "test_every_case_comes_out_as_its_file_expects": (
        *("change_point", "isosceles_slider", "mass_ratio", "near_parallel", "scale_metre"),
        *("straight_snake", "third_crank", "tumbling", "stiff_", "scale_micrometre"),
    ),
    "test_every_choice_of_every_model_passes": (
        *("andrews", "bicycle", "car_axis", "chaplygin_sleigh", "double_pendulum", "gear_train"),
        *("mobile_manipulator", "pendulum", "planar_3r", "rolling_sphere", "rolling_torus"),
        *("slider_crank", "snakeboard", "spatial_four_bar", "universal_shaft", "tractor_trailers"),
        *("snake3", "screw_press", "stanford_arm"),
    ),
    "test_every_combination_agrees_or_is_refused": (
        *("ellipsoid", "rolling_disk", "four_bar-udwadia", "four_bar-maggi", "cart"),
        "double_pendulum",
    ),
    "test_order_is_nominal": ("ellipsoid", "rolling_disk", "cart", "double_pendulum"),
    "test_extreme_models": (
        *("bicycle_toroidal", "bricard", "four_bar_chain", "isosceles_slider", "long_run"),
        *("third_crank", "scale_metre"),
    ),
    "test_published_digits": ("andrews", "car_axis", "pendulum-options6"),
    "test_wrong_terms_of_the_system_are_caught": ("bead_in_bowl", "snake3", "rolling_disk"),
    "test_every_planted_error_is_caught": ("free_body", "bead_on_wire"),
    "test_simulation": ("rosenbrock", "implicit_midpoint"),
    "test_other_widths_give_the_same_rows": ("8",),
    "test_rounding_stays_small": ("stanford_arm", "snake3"),
    "test_trees_need_no_more_than_their_graph": ("chain of 30",),
    "test_four_bar_stays_closed_and_in_balance": ("best",),
    "test_planted_errors_are_caught_at_every_scale": ("tiny",),
    "test_what_is_printed_is_what_is_compiled": ("snake3-hinges", "snake3-maggi", "mobile", "best"),
}
WHOLE = {  # every run of these
    "test_universal_shaft_by_the_angles_of_its_crosses",
    "test_the_euclidean_metric_leads_to_the_same_motion",
    "test_chain_through_its_singular_positions",
    "test_verify_prefixes_checks_with_the_choice",
    "test_a_pivot_that_vanishes_on_the_way_is_told",
    "test_the_energy_is_held_through_the_changes",
    "test_a_coarse_tolerance_does_not_add_up_over_singular_positions",
    "test_a_choice_that_is_none_does_not_keep_the_others_from_being_verified",
    "test_extreme_cases_are_on_the_page",
    "test_four_bar_goes_through_the_dead_centres_of_its_rocker",
    "test_it_can_start_in_any_chart",
    "test_stiff_cases_need_at_most_three_times_the_steps_of_scipy",
    "test_a_hundred_states_and_json",
    "test_where_no_other_choice_may_take_over_the_motion_ends_with_the_reason",
    "test_verification_sees_every_chart_and_the_way_between",
    "test_guesses_move_silently_and_held_values_are_reported_when_they_move",
    "test_a_and_b_go_to_python_control",
    "test_many_turns_stay_on_the_constraints",
    "test_the_package_verify_does_not_hide_the_verb",
    "test_long_lists_of_names_are_summarised",
    "test_constants_by_name",
    "test_what_is_left_of_velocity_products_is_no_error",
    "test_parts_compute_the_same",
    "test_without_a_compiler_numpy_finds_the_same_motion",
    "test_generalized_velocities_make_no_charts",
    "test_only_the_functions_asked_for",
    "test_a_build_with_a_wrong_sign_is_refused",
    "test_what_goes_one_by_one_is_the_same",
}


def pytest_collection_modifyitems(items):
    for item in items:
        test, _, run = item.name.partition("[")
        parts = (*LONG[""], *LONG.get(test, ()))
        if test in WHOLE or any(part in run for part in parts):
            item.add_marker(pytest.mark.slow)
