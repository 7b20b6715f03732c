// The rival of regressor_speed.py: Pinocchio's C++ in a compiled loop over samples, on the same arrays.
// Templates are instantiated here, so they get this file's compiler flags (-O3 -march=native).
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/algorithm/parallel/rnea.hpp>
#include <pinocchio/algorithm/regressor.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody.hpp>

namespace {
pinocchio::Model model;
pinocchio::Data *data = nullptr;
pinocchio::ModelPool *pool = nullptr;
using Map = Eigen::Map<const Eigen::VectorXd>;
}  // namespace

extern "C" {
// A chain of revolute joints: rotation (9, row by row), position (3) and inertia (10, Pinocchio's order) of each.
void peer_robot(int joints, const double *rotation, const double *position, const double *inertia,
                const double *gravity)
{
    model = pinocchio::Model();
    model.gravity.linear() = Eigen::Map<const Eigen::Vector3d>(gravity);
    pinocchio::JointIndex parent = 0;
    for (int j = 0; j < joints; ++j) {
        Eigen::Matrix3d R = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rotation + 9 * j);
        Eigen::Vector3d p = Eigen::Map<const Eigen::Vector3d>(position + 3 * j);
        parent = model.addJoint(parent, pinocchio::JointModelRZ(), pinocchio::SE3(R, p), "j" + std::to_string(j));
        Eigen::Matrix<double, 10, 1> phi = Eigen::Map<const Eigen::Matrix<double, 10, 1>>(inertia + 10 * j);
        model.appendBodyToJoint(parent, pinocchio::Inertia::FromDynamicParameters(phi), pinocchio::SE3::Identity());
    }
    delete data;
    data = new pinocchio::Data(model);
    delete pool;
    pool = new pinocchio::ModelPool(model, 2);
}

// Sum over samples of one entry, so that nothing is optimised away; `last` (n x 10 n) is the last regressor.
double peer_regressor(long rows, const double *q, const double *dq, const double *ddq, double *last)
{
    const int n = model.nv;
    double sum = 0;
    for (long i = 0; i < rows; ++i) {
        pinocchio::computeJointTorqueRegressor(model, *data, Map(q + i * n, n), Map(dq + i * n, n),
                                               Map(ddq + i * n, n));
        sum += data->jointTorqueRegressor(0, 10 * n - 1);
    }
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(last, n, 10 * n) =
        data->jointTorqueRegressor;
    return sum;
}

void peer_rnea(long rows, const double *q, const double *dq, const double *ddq, double *tau)
{
    const int n = model.nv;
    for (long i = 0; i < rows; ++i)
        Eigen::Map<Eigen::VectorXd>(tau + i * n, n) =
            pinocchio::rnea(model, *data, Map(q + i * n, n), Map(dq + i * n, n), Map(ddq + i * n, n));
}

// Pinocchio's own parallel loop (OpenMP), on two threads.
void peer_rnea_two_threads(long rows, const double *q, const double *dq, const double *ddq, double *tau)
{
    using Columns = Eigen::Map<const Eigen::MatrixXd>;
    const int n = model.nv;
    Eigen::Map<Eigen::MatrixXd> out(tau, n, rows);
    pinocchio::rneaInParallel(2, *pool, Columns(q, n, rows), Columns(dq, n, rows), Columns(ddq, n, rows), out);
}
}
