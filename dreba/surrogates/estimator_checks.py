"""Checks of scikit-learn that kinds of posture columns do not pass, with the reasons, for `check_estimator`."""

from __future__ import annotations

from typing import Final

COLUMNS: Final = (
    "the data of the check are not the 22 columns of a posture table: this kind knows what each of its columns is, and "
    "refuses others"
)
MESSAGE: Final = "as before, and the refusal of the columns comes before the message that the check expects"
POSTURE_COLUMNS: Final[dict[str, str]] = {
    **dict.fromkeys(
        (
            "check_dict_unchanged", "check_dont_overwrite_parameters", "check_dtype_object",
            "check_estimators_dtypes", "check_estimators_fit_returns_self", "check_estimators_nan_inf",
            "check_estimators_overwrite_params", "check_estimators_pickle", "check_f_contiguous_array_estimator",
            "check_fit2d_predict1d", "check_fit_check_is_fitted", "check_fit_idempotent", "check_fit_score_takes_y",
            "check_methods_sample_order_invariance", "check_methods_subset_invariance", "check_n_features_in",
            "check_n_features_in_after_fitting", "check_pipeline_consistency", "check_positive_only_tag_during_fit",
            "check_readonly_memmap_input", "check_regressor_data_not_an_array", "check_regressors_int",
            "check_regressors_no_decision_function", "check_regressors_train",
            "check_sample_weight_equivalence_on_dense_data", "check_sample_weights_list",
            "check_sample_weights_not_an_array", "check_sample_weights_not_overwritten",
            "check_sample_weights_pandas_series", "check_sample_weights_shape", "check_supervised_y_2d",
        ),
        COLUMNS,
    ),
    "check_fit2d_1feature": MESSAGE,
    "check_fit2d_1sample": MESSAGE,
}  # fmt: skip
"""Name of a check -> why a kind that takes posture columns only does not pass it."""
