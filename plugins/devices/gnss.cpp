// gnss: position and velocity of an antenna as a receiver of a navigation system gives them, sampled, in axes of the world or of a planet
// that turns. Its error is white and one that wanders (Gauss-Markov of the first order), alike along all three axes.
#include "plugins/devices/inertial_sensor.hpp"
#include "plugins/fields/planet.hpp"

namespace cardan {
namespace {

struct Gnss {
  static constexpr const char* type = "gnss";
  static constexpr const char* summary = "position and velocity of a node in axes of the world or of a planet, sampled, with noise";
  static constexpr unsigned facts = 0;
  static constexpr unsigned role = CARDAN_ROLE_SENSOR;
  struct Packed {
    TurningPlanet planet;
    std::int64_t turns;  // its axes with the planet
    double noise, velocity_noise, wander, wander_time, farthest;
  };
  static constexpr const char* kAxes[] = {"world", "planet"};
  static constexpr cardan_param_desc schema[] = {
      param::named(param::optional("axes", CARDAN_CHOICE, "1",
                                   "of what it tells: of the world, or from the centre of a planet in its axes, "
                                   "with the velocity relative to it"),
                   kAxes),
      param::not_negative(param::optional("position_noise", CARDAN_NUMBER, "m", "standard deviation of a sample along each axis")),
      param::not_negative(param::optional("velocity_noise", CARDAN_NUMBER, "m/s", "standard deviation of a sample along each axis")),
      param::not_negative(
          param::optional("position_wander", CARDAN_NUMBER, "m", "standard deviation of its error that wanders, along each axis")),
      param::positive(param::optional("wander_time", CARDAN_NUMBER, "s", "over which that error forgets", 1800.0)),
      param::not_negative(param::optional("max_distance", CARDAN_NUMBER, "m", "from the centre, beyond which it has no fix; 0: any")),
      param::optional("planet_rate", CARDAN_NUMBER, "rad/s", "of the planet about its axis", TurningPlanet::kEarthRate),
      TurningPlanet::centre_desc,
      TurningPlanet::axis_desc,
      TurningPlanet::meridian_desc,
      TurningPlanet::epoch_desc,
      TurningPlanet::dut1_desc,
      TurningPlanet::orientation_desc,
      TurningPlanet::pole_x_desc,
      TurningPlanet::pole_y_desc,
      TurningPlanet::bulletin_desc};
  static constexpr cardan_mount_desc mounts[] = {
      {"at", CARDAN_MOUNT_NODE, CARDAN_USE_POSE | CARDAN_USE_VELOCITY, "the node of the antenna"}};
  static constexpr cardan_port_desc ports[] = {
      {"available", CARDAN_PORT_IN, "1", 1.0, 0, "0: there is no signal"},
      {"position_x", CARDAN_PORT_OUT, "m", 0.0, 0, "as read", nullptr, 0, "valid"},
      {"position_y", CARDAN_PORT_OUT, "m", 0.0, 0, "as read", nullptr, 0, "valid"},
      {"position_z", CARDAN_PORT_OUT, "m", 0.0, 0, "as read", nullptr, 0, "valid"},
      {"velocity_x", CARDAN_PORT_OUT, "m/s", 0.0, 0, "as read", nullptr, 0, "valid"},
      {"velocity_y", CARDAN_PORT_OUT, "m/s", 0.0, 0, "as read", nullptr, 0, "valid"},
      {"velocity_z", CARDAN_PORT_OUT, "m/s", 0.0, 0, "as read", nullptr, 0, "valid"},
      {"valid", CARDAN_PORT_OUT, "1", 0.0, 0, "1: it is of the last sample; 0: of the last one that had a fix"}};
  static constexpr cardan_state_desc marks[] = {{"position_x", "m", 0.0, 1.0, "held since the last good sample"},
                                                {"position_y", "m", 0.0, 1.0, "held since the last good sample"},
                                                {"position_z", "m", 0.0, 1.0, "held since the last good sample"},
                                                {"velocity_x", "m/s", 0.0, 1.0, "held since the last good sample"},
                                                {"velocity_y", "m/s", 0.0, 1.0, "held since the last good sample"},
                                                {"velocity_z", "m/s", 0.0, 1.0, "held since the last good sample"},
                                                {"valid", "1", 0.0, 1.0, "of the last sample"},
                                                {"error_x", "m", 0.0, 1.0, "that wanders"},
                                                {"error_y", "m", 0.0, 1.0, "that wanders"},
                                                {"error_z", "m", 0.0, 1.0, "that wanders"},
                                                {"sampled", "1", 0.0, 1.0, "1: it has"}};
  static constexpr std::uint32_t n_noise = 9;

  static bool pack(const Params& params, Packed& p) {
    const auto n = [&](const char* key) { return params.number(key); };
    p.turns = params.choice("axes");
    p.noise = n("position_noise"), p.velocity_noise = n("velocity_noise"), p.wander = n("position_wander"),
    p.wander_time = n("wander_time");
    p.farthest = n("max_distance");
    return p.planet.pack(params, "planet_rate");
  }

  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    give_held<7>(in, out);
  }

  static int tick(const Packed& p, const DeviceIn<double>& in, double period, const double* noise, double*, double* d) noexcept {
    const InertialSensor error{.wander = p.wander, .wander_time = p.wander_time};
    for (int i = 0; i < 3; ++i) d[7 + i] = error.wandered(d[7 + i], period, d[10] == 0.0, noise[6 + i]);
    d[10] = 1.0;
    const MountMotion<double>& at = in.at[0];
    const Vec3<double> v = at.R_WN * at.velocity;
    const Eigen::Vector3d from = Eigen::Vector3d(at.position.x, at.position.y, at.position.z) - as_vector(p.planet.centre);
    d[6] = in.in[0] != 0.0 && !(p.farthest > 0.0 && from.norm() > p.farthest) ? 1.0 : 0.0;
    if (d[6] == 0.0) return 0;
    Eigen::Vector3d position{at.position.x, at.position.y, at.position.z}, velocity{v.x, v.y, v.z};
    if (p.turns) {
      if (!p.planet.is_known(in.t)) return 1;
      const PlanetAxes axes = PlanetAxes::at(p.planet, in.t);
      const Eigen::Map<const Eigen::Matrix3d> columns(axes.columns);
      position = columns.transpose() * from;
      velocity = columns.transpose() * velocity - p.planet.rate * Eigen::Vector3d(-position.y(), position.x(), 0.0);
    }
    for (int i = 0; i < 3; ++i)
      d[i] = position[i] + d[7 + i] + p.noise * noise[i], d[3 + i] = velocity[i] + p.velocity_noise * noise[3 + i];
    return 0;
  }
  static const char* explain(const Packed&, int) { return "the date is outside of the days of `bulletin`"; }
};

}  // namespace
const cardan_device_family& gnss_family() { return device_table<Gnss>(); }
}  // namespace cardan
