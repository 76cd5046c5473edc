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


def pytest_collection_modifyitems(items):
    for item in items:
        test, _, run = item.name.partition("[")
        parts = (*LONG[""], *LONG.get(test, ()))
        if any(part in run for part in parts):
            item.add_marker(pytest.mark.slow)
