"""What holds for all tests: of a test that loops over models, methods or cases, the longest runs
take part only when slow tests run, and every kind keeps one that is quick."""

import pytest

LONG = {
    "": ("waveboard",),
    "test_models_need_no_more_than_their_graph": ("bicycle",),
    "test_every_case_comes_out_as_its_file_expects": (
        *("change_point", "isosceles_slider", "mass_ratio", "near_parallel", "scale_metre"),
        *("straight_snake", "third_crank", "tumbling", "stiff_damper"),
    ),
    "test_every_choice_of_every_model_passes": (
        *("andrews", "bicycle", "car_axis", "chaplygin_sleigh", "double_pendulum", "gear_train"),
        *("mobile_manipulator", "pendulum", "planar_3r", "rolling_sphere", "rolling_torus"),
        *("slider_crank", "snakeboard", "spatial_four_bar", "universal_shaft"),
    ),
    "test_extreme_models": (
        *("bicycle_toroidal", "bricard", "four_bar_chain", "isosceles_slider", "long_run"),
        *("third_crank", "scale_metre"),
    ),
    "test_published_digits": (
        "andrews-options1",
        "andrews-options2",
        "car_axis-options4",
        "pendulum-options6",
    ),
    "test_wrong_terms_of_the_system_are_caught": ("bead_in_bowl", "snake3"),
    "test_every_planted_error_is_caught": ("free_body", "bead_on_wire"),
    "test_a_coarse_tolerance_does_not_add_up_over_singular_positions": ("verner9",),
    "test_the_energy_is_held_through_the_changes": ("invariants_euclidean",),
    "test_simulation": ("rosenbrock", "implicit_midpoint"),
    "test_universal_shaft_by_the_angles_of_its_crosses": ("",),
    "test_the_euclidean_metric_leads_to_the_same_motion": ("",),
    "test_chain_through_its_singular_positions": ("",),
}


def pytest_collection_modifyitems(items):
    for item in items:
        test, _, run = item.name.partition("[")
        parts = (*LONG[""], *LONG.get(test, ()))
        if any(part in run for part in parts):
            item.add_marker(pytest.mark.slow)
