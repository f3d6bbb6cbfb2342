from . import (
    control as control,
    description as description,
    dynamics as dynamics,
    grading as grading,
    kinematics as kinematics,
    lab as lab,
    model as model,
    planning as planning,
    programs as programs,
    report as report,
    symbolic as symbolic,
    trajectories as trajectories,
    verification as verification,
    viewer as viewer,
)
from .arm import Arm as Arm
from .control import (
    LQR as LQR,
    PID as PID,
    Adaptive as Adaptive,
    BatchOptions as BatchOptions,
    BatchResult as BatchResult,
    Comparison as Comparison,
    ComputedTorque as ComputedTorque,
    FeedForward as FeedForward,
    FrictionCompensation as FrictionCompensation,
    OperationalSpace as OperationalSpace,
    PDGravity as PDGravity,
    Push as Push,
    Sensors as Sensors,
    SimulationOptions as SimulationOptions,
    SimulationResult as SimulationResult,
    Sine as Sine,
    Step as Step,
    ToolPoses as ToolPoses,
)
from .description import (
    Description as Description,
    DHTable as DHTable,
    pose as pose,
    pose_parts as pose_parts,
    robots as robots,
)
from .dynamics import (
    ForwardDynamicsDerivatives as ForwardDynamicsDerivatives,
    Friction as Friction,
    InverseDynamicsDerivatives as InverseDynamicsDerivatives,
)
from .errors import (
    AnswerError as AnswerError,
    DescriptionError as DescriptionError,
    DhkitError as DhkitError,
    ExpressionError as ExpressionError,
    MissingPackageError as MissingPackageError,
    ModelError as ModelError,
    PlanningError as PlanningError,
    SimulationError as SimulationError,
    UnreachableError as UnreachableError,
)
from .grading import GradeOptions as GradeOptions, GradeReport as GradeReport, grade as grade
from .kinematics import (
    Classification as Classification,
    IKFlag as IKFlag,
    IKPath as IKPath,
    IKSolutions as IKSolutions,
    IKStatus as IKStatus,
    Singularities as Singularities,
    Workspace as Workspace,
)
from .planning import (
    Certificate as Certificate,
    Distances as Distances,
    Effort as Effort,
    Energy as Energy,
    Floor as Floor,
    Jerk as Jerk,
    MotorPower as MotorPower,
    Obstacle as Obstacle,
    PathOptions as PathOptions,
    Payload as Payload,
    Planner as Planner,
    PlanOptions as PlanOptions,
    Time as Time,
    ToolAcceleration as ToolAcceleration,
    ToolDirection as ToolDirection,
    ToolOrientation as ToolOrientation,
    ToolSpeed as ToolSpeed,
    TorqueSpeedLine as TorqueSpeedLine,
)
from .report import Report as Report
from .symbolic import (
    BaseParameters as BaseParameters,
    CasadiFunctions as CasadiFunctions,
    Lagrangian as Lagrangian,
    SymbolicKinematics as SymbolicKinematics,
)
from .trajectories import JointPath as JointPath, Limits as Limits, Trajectory as Trajectory
from .verification import VerificationReport as VerificationReport
from .viewer import View as View, plot as plot

__version__: str
