from .differentiable.casadi_functions import CasadiFunctions as CasadiFunctions
from .differentiable.composite_bodies import (
    composite_coriolis_matrix as composite_coriolis_matrix,
    composite_mass_matrix as composite_mass_matrix,
)
from .differentiable.derivatives import (
    derivative_of_matrix as derivative_of_matrix,
    mass_matrix_derivative as mass_matrix_derivative,
    recursive_forward_dynamics_derivatives as recursive_forward_dynamics_derivatives,
    recursive_inverse_dynamics_derivatives as recursive_inverse_dynamics_derivatives,
)
from .differentiable.energies import (
    kinetic_energy as kinetic_energy,
    lagrange_coriolis_matrix as lagrange_coriolis_matrix,
    lagrange_gravity_torque as lagrange_gravity_torque,
    lagrange_inverse_dynamics as lagrange_inverse_dynamics,
    lagrange_mass_matrix as lagrange_mass_matrix,
    lagrange_torque as lagrange_torque,
    potential_energy as potential_energy,
)
from .differentiable.forward_dynamics import (
    SINGULAR as SINGULAR,
    recursive_forward_dynamics as recursive_forward_dynamics,
    solve_for_acceleration as solve_for_acceleration,
)
from .differentiable.frames import (
    ReferenceAxes as ReferenceAxes,
    SymbolicTable as SymbolicTable,
    jacobian as jacobian,
    jacobian_dot as jacobian_dot,
    joint_symbols as joint_symbols,
    table_pattern as table_pattern,
)
from .differentiable.friction import (
    Friction as Friction,
    friction_parameters as friction_parameters,
    friction_torque as friction_torque,
)
from .differentiable.inertial_table import (
    InertialTable as InertialTable,
    inertial_pattern as inertial_pattern,
)
from .differentiable.moments import Moments as Moments
from .differentiable.recursive import (
    recursive_bias as recursive_bias,
    recursive_gravity as recursive_gravity,
    recursive_inverse_dynamics as recursive_inverse_dynamics,
)
from .differentiable.velocity_regressor import velocity_regressor as velocity_regressor
from .exact.base_parameters import (
    BaseColumn as BaseColumn,
    BaseParameters as BaseParameters,
    base_parameters as base_parameters,
)
from .exact.exact_arm import ExactArm as ExactArm, exact_arm as exact_arm
from .exact.lagrangian import Lagrangian as Lagrangian, Proof as Proof, lagrangian as lagrangian
from .exact.naming import Symbols as Symbols
from .exact.regressor import Regressor as Regressor
from .inverse.chain import table_lengths as table_lengths
from .inverse.derivation import (
    InverseDerivation as InverseDerivation,
    InverseProof as InverseProof,
    inverse_derivation as inverse_derivation,
)
from .kinematics import (
    SymbolicKinematics as SymbolicKinematics,
    SymbolicMatrix as SymbolicMatrix,
    symbolic_kinematics as symbolic_kinematics,
)
from .mistakes import MISTAKES as MISTAKES, MadeAt as MadeAt, Mistake as Mistake, Subject as Subject
from .programs.graph import (
    Graph as Graph,
    Node as Node,
    Variable as Variable,
    operation_count as operation_count,
)
from .programs.loop import Loop as Loop
from .programs.pipeline import (
    Pipeline as Pipeline,
    PipelineStep as PipelineStep,
    Program as Program,
)
from .programs.printers import c_source as c_source, export_c as export_c
from .ring.elements import Element as Element, Elements as Elements, RingError as RingError
from .textbook import TextbookDerivation as TextbookDerivation, derive as derive
