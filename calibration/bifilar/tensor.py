"""The inertia tensor from hangs about several axes: ``I_k = n_k' I n_k``, by weighted least squares."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.bifilar.errors import RigError
from calibration.bifilar.inertia import InertiaResult
from calibration.bifilar.plausibility import check_misfit, check_triangle
from calibration.measurement import Estimate, Finding, coverage_factor
from onboard.arrays import FloatArray

ELEMENTS = ("xx", "yy", "zz", "xy", "xz", "yz")
"""Names of the elements, in the order of all vectors here; ``xy`` is the element of the matrix, minus the
product of inertia."""

FULL_TENSOR_HANGS = 6
_WORST_CONDITION = 50.0


@dataclass(frozen=True, slots=True, eq=False)
class InertiaTensor:
    """The drone's inertia, body frame, about its centre of mass.

    Attributes:
        matrix: kg m2, (3, 3). Products are zero where fewer than six hangs were made.
        elements: kg m2, by name in :data:`ELEMENTS`; only the diagonal from fewer than six hangs.
        covariance: (kg m2)2, of the elements in their order.
        principal: kg m2, rising. axes: (3, 3), their directions as columns.
        misfit: largest difference of a hang from the tensor, in its own standard uncertainties; 0 where
            there are as many elements as hangs.
        findings: of the triangle inequality and the misfit of the hangs.
    """

    matrix: FloatArray
    elements: dict[str, Estimate]
    covariance: FloatArray
    principal: FloatArray
    axes: FloatArray
    misfit: float
    findings: tuple[Finding, ...]


def inertia_tensor(hangs: Sequence[InertiaResult]) -> InertiaTensor:
    """Least squares on the hangs, each about the axis that its gyro saw.

    Errors of lengths, mass and g are shared by all hangs of one rig and do not average out.

    Raises:
        RigError: fewer than three hangs, or axes that do not span what is asked.
    """
    if len(hangs) < 3:
        raise RigError(f"{len(hangs)} hang(s): three different axes give the diagonal, six the full tensor")
    rows = _design(hangs)
    values = np.array([hang.inertia.value for hang in hangs])
    own, common = np.array([hang.shares for hang in hangs]).T
    weights = 1.0 / np.maximum(own * values, 1e-6 * values)
    if np.linalg.cond(rows) > _WORST_CONDITION:
        raise RigError(
            f"the axes of the {len(hangs)} hangs do not determine {rows.shape[1]} elements; "
            "hang x, y and z, and the three diagonals between them"
        )
    solve = np.linalg.pinv(rows * weights[:, None]) * weights
    elements = solve @ values
    shared = common * values
    covariance = solve @ (np.diag((own * values) ** 2) + np.outer(shared, shared)) @ solve.T
    return _result(hangs, rows, elements, covariance, (values - rows @ elements) * weights)


def _design(hangs: Sequence[InertiaResult]) -> FloatArray:
    x, y, z = np.array([hang.axis for hang in hangs]).T
    columns = [x * x, y * y, z * z]
    if len(hangs) >= FULL_TENSOR_HANGS:
        columns += [2.0 * x * y, 2.0 * x * z, 2.0 * y * z]
    return np.column_stack(columns)


def _result(
    hangs: Sequence[InertiaResult],
    rows: FloatArray,
    elements: FloatArray,
    covariance: FloatArray,
    pulls: FloatArray,
) -> InertiaTensor:
    dof = min(hang.inertia.dof for hang in hangs)
    full = np.zeros(6)
    full[: len(elements)] = elements
    xx, yy, zz, xy, xz, yz = full
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    principal, axes = np.linalg.eigh(matrix)
    misfit = float(np.max(np.abs(pulls))) if len(hangs) > rows.shape[1] else 0.0
    excess_sigma = math.sqrt(float(np.trace(covariance[:3, :3])))
    return InertiaTensor(
        matrix=matrix,
        elements={
            name: Estimate(float(value), "kg m2", math.sqrt(float(variance)), dof)
            for name, value, variance in zip(ELEMENTS, elements, np.diag(covariance), strict=False)
        },
        covariance=covariance,
        principal=principal,
        axes=axes,
        misfit=misfit,
        findings=(
            *check_triangle([float(v) for v in principal], coverage_factor(dof) * excess_sigma),
            *check_misfit(misfit),
        ),
    )
