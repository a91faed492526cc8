#include "impedance.hpp"

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace pilotfish {

namespace {

using Vector3 = Eigen::Vector3d;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Joints = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, MAX_JOINTS, 1>;
using Jacobian = Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::RowMajor, 6, MAX_JOINTS>;

Eigen::Map<const Joints> joints(const double* values, int n) { return {values, n}; }
Eigen::Map<const Vector6> vector6(const double* values) { return Eigen::Map<const Vector6>(values); }
Eigen::Map<const Vector3> vector3(const double* values) { return Eigen::Map<const Vector3>(values); }

Joints zero_non_finite(Joints values) {
  for (double& value : values)
    if (!std::isfinite(value)) value = 0.0;
  return values;
}

// Returns the rotation vector of q p^-1 in world axes, for the nearer of q and -q; NaN if a quaternion is
// zero.
Vector3 rotation_error(const double* p, const double* q) {
  const auto from = vector3(p + 1), to = vector3(q + 1);
  const double w = p[0] * q[0] + from.dot(to);
  const Vector3 vector = p[0] * to - q[0] * from - to.cross(from);
  const double sine = std::sqrt(vector.squaredNorm());
  if (!(std::abs(w) + sine > 0.0)) return Vector3::Constant(std::numeric_limits<double>::quiet_NaN());
  const double angle = 2.0 * std::atan2(sine, std::abs(w));
  return vector * (sine > 0.0 ? std::copysign(angle / sine, w) : 0.0);
}

// Scales force and moment down to their limits; NaN if a norm is not finite.
Vector6 limit_wrench(const Arm& arm, Vector6 wrench) {
  const double force = std::sqrt(wrench.head<3>().squaredNorm());
  const double moment = std::sqrt(wrench.tail<3>().squaredNorm());
  if (!std::isfinite(force + moment)) return Vector6::Constant(std::numeric_limits<double>::quiet_NaN());
  wrench.head<3>() *= std::min(1.0, arm.force_limit / force);
  wrench.tail<3>() *= std::min(1.0, arm.moment_limit / moment);
  return wrench;
}

Vector6 impedance_wrench(const Arm& arm, const Jacobian& J) {
  Vector6 error;
  error << vector3(arm.target_position) - vector3(arm.position),
      rotation_error(arm.quaternion, arm.target_quaternion);
  const Vector6 spring = limit_wrench(arm, vector6(arm.stiffness).cwiseProduct(error));
  const Vector6 twist_error = J * joints(arm.velocity, arm.n) - vector6(arm.twist);
  return limit_wrench(arm, spring - vector6(arm.damping).cwiseProduct(twist_error));
}

// Computes F and J^T F + (I - J^T J^+T) k_q (q_neutral - q); returns false if one of them is not finite.
bool task_torque(const Arm& arm, Vector6& F, Joints& task) {
  const Jacobian J = Eigen::Map<const Jacobian>(arm.jacobian, 6, arm.n);
  F = impedance_wrench(arm, J);
  const Matrix6 gram = J * J.transpose();
  if (!F.allFinite() || !gram.allFinite()) return false;
  const Eigen::SelfAdjointEigenSolver<Matrix6> solver(gram);  // squared singular values of J
  const Joints posture = arm.posture_stiffness * (joints(arm.posture, arm.n) - joints(arm.q, arm.n));
  const Vector6 values = solver.eigenvalues().cwiseMax(arm.min_singular_value * arm.min_singular_value);
  const Vector6 along = solver.eigenvectors().transpose() * (J * posture);
  const Vector6 pseudo = solver.eigenvectors() * along.cwiseQuotient(values);  // J^+T posture
  task = J.transpose() * (F - pseudo) + posture;
  return task.allFinite();
}

Joints joint_limit_torque(const Arm& arm) {
  const auto q = joints(arm.q, arm.n);
  Joints push(arm.n);
  for (int i = 0; i < arm.n; ++i) {
    const double below = arm.lower[i] + arm.limit_margin - q[i];
    const double above = q[i] - (arm.upper[i] - arm.limit_margin);
    push[i] = arm.limit_stiffness * (std::max(below, 0.0) - std::max(above, 0.0));
  }
  return push;
}

// Clips bias + push to the limits; returns the smallest fraction of its push that a joint could apply. See
// clip_torque in kernels/arm_types.py.
double clip_torque(const Arm& arm, const Joints& bias, const Joints& push, double* torque) {
  double fraction = 1.0;
  for (int i = 0; i < arm.n; ++i) {
    const double limit = arm.torque[i], requested = bias[i] + push[i];
    torque[i] = std::min(std::max(requested, -limit), limit);
    if (torque[i] == requested) continue;
    const double clipped_bias = std::min(std::max(bias[i], -limit), limit);
    fraction = std::min(fraction, push[i] == 0.0 ? 0.0 : (torque[i] - clipped_bias) / push[i]);
  }
  return fraction;
}

}  // namespace

double impedance_torque(const Arm& arm, double* torque, double* wrench) {
  Joints push = zero_non_finite(joint_limit_torque(arm)) -
                zero_non_finite(arm.joint_damping * joints(arm.velocity, arm.n));
  Vector6 F;
  Joints task(arm.n);
  if (!task_torque(arm, F, task)) {
    F.setZero();
    task.setZero();
  }
  Eigen::Map<Vector6>{wrench} = F;
  return clip_torque(arm, zero_non_finite(joints(arm.bias, arm.n)), zero_non_finite(push + task), torque);
}

}  // namespace pilotfish
