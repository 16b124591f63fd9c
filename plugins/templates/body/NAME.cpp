// @TYPE@: a pipe, a hollow cylinder of one material along x of the body, its centre in the origin.
// With R, r the radii and L the length: m = pi rho (R^2 - r^2) L, J_xx = m (R^2 + r^2) / 2, J_yy = J_zz = m (3 (R^2 + r^2) + L^2) / 12.
// A body may have modes of its own as well: CARDAN_MASS_MODES in core/abi/cardan_body.h.
#include <algorithm>
#include <limits>
#include <numbers>

#include "core/abi/cardan_body.h"
#include "core/abi/family.hpp"

namespace {

using namespace cardan;

// The host converts units, checks ranges, and shows all of this by `cardan types`.
constexpr cardan_param_desc positive(const cardan_param_desc& desc) {
  return param::in_range(desc, 0.0, std::numeric_limits<double>::infinity(), CARDAN_ABOVE);
}
constexpr cardan_param_desc kSchema[] = {positive(param::required("length", CARDAN_NUMBER, "m", "along x")),
                                         positive(param::required("radius", CARDAN_NUMBER, "m", "of the outer surface")),
                                         positive(param::required("wall", CARDAN_NUMBER, "m", "thickness of the wall; at most the radius")),
                                         positive(param::optional("density", CARDAN_NUMBER, "kg/m^3", "mass per volume", 2700.0))};

/// Mass [kg], mass centre [m], inertia about it [kg m^2] (xx yy zz xy xz yz), axes of the body. 0: done.
int rigid(const cardan_param_values* values, double* mass, double com[3], double inertia[6]) {
  const Params params(values);
  const double R = params.number("radius"), r = R - params.number("wall"), L = params.number("length");
  if (r < 0.0) {
    params.fail("wall", "a wall that is not thicker than the radius");
    return 1;
  }
  const double m = *mass = std::numbers::pi * params.number("density") * (R * R - r * r) * L;
  std::fill_n(com, 3, 0.0);
  std::fill_n(inertia, 6, 0.0);
  inertia[0] = m * (R * R + r * r) / 2;
  inertia[1] = inertia[2] = m * (3 * (R * R + r * r) + L * L) / 12;
  return 0;
}

const cardan_body_family& pipe() {
  static const cardan_body_family table = [] {
    cardan_body_family t{};
    t.struct_size = sizeof t;
    t.type = "@TYPE@";
    t.summary = "a hollow cylinder of one material along x";
    t.mass_source = CARDAN_MASS_COMPUTED;
    t.params = kSchema, t.n_params = std::size(kSchema), t.param_size = sizeof kSchema[0];
    t.rigid = rigid;
    return t;
  }();
  return table;
}

const void* family(const char* kind, std::uint32_t index) {
  return std::string_view(kind) == CARDAN_KIND_BODY && index == 0 ? &pipe() : nullptr;
}
const cardan_plugin kPlugin{sizeof(cardan_plugin), CARDAN_ABI_MAJOR, CARDAN_ABI_MINOR, "@NAME@", "0.1", "", family};

}  // namespace

extern "C" CARDAN_EXPORT const cardan_plugin* cardan_plugin_entry(const cardan_host* host) {
  return host->abi_major == CARDAN_ABI_MAJOR ? &kPlugin : nullptr;
}
