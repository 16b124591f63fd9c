// MJCF: nested bodies, several joints each, classes of defaults, inertia from simple geoms, equalities.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <list>
#include <map>
#include <numbers>
#include <utility>

#include "core/base/units.hpp"
#include "core/spatial/rotation.hpp"
#include "scripts/import/source.hpp"

namespace cardan {
namespace {

using Kind = RobotJoint::Kind;
constexpr std::string_view kOrientations = "quat axisangle euler xyaxes zaxis";
/// What counts of elements that classes of defaults may describe, and what means nothing here.
constexpr std::string_view kJoint =
    "name class type pos axis springdamper limited range stiffness springref armature damping frictionloss ref";
constexpr std::string_view kJointIgnored =
    "group margin solreflimit solimplimit solreffriction solimpfriction actuatorfrcrange actuatorfrclimited actuatorgravcomp user align";
constexpr std::string_view kGeom = "name class type size mass density shellinertia fromto pos quat axisangle xyaxes zaxis euler mesh";
constexpr std::string_view kGeomIgnored =
    "contype conaffinity condim group priority material friction solmix solref solimp margin gap hfield fitscale rgba fluidshape "
    "fluidcoef user";
constexpr std::string_view kSite = "name class type fromto pos quat axisangle xyaxes zaxis euler";
constexpr std::string_view kSiteIgnored = "group material size rgba user";
constexpr double kPi = std::numbers::pi;

/// A geom as a mass.
struct GeomMass {
  double mass;
  Vec3<double> com;
  Sym3<double> J;  // about com, body axes
};

class MjcfReader {
 public:
  MjcfReader(const XmlElement& root, RobotSource& source) : root_(root), source_(source) {}

  Robot read() {
    robot_.format = "MJCF";
    robot_.file = source_.file;
    if (const XmlAttribute* name = root_.attribute("model")) robot_.name = name->value;
    robot_.gravity = Vec3<double>{0, 0, -9.81};
    classes_.emplace("main", &all_classes_.emplace_back());
    bodies_.emplace("world", -1);
    if (source_.options.base != ImportOptions::Base::automatic)
      refuse(Code::command_line, {"--base"}, "an option of URDF alone", "a file in MJCF", "there a freejoint makes a base free");
    for (const XmlElement& e : root_.children) {
      if (e.name == "compiler") read_compiler(e);
      if (e.name == "option") read_option(e);
      if (e.name == "default") read_default(e, nullptr);
    }
    for (const XmlElement& e : root_.children) read_section(e);
    source_.sink.throw_if_any();
    if (robot_.links.empty()) source_.report(Code::empty_system, root_, {}, "at least one body", "none");
    source_.sink.throw_if_any();
    for (const RobotLink& link : robot_.links) {  // all coordinates zero
      const Pose<double> inboard = link.parent < 0 ? Pose<double>{} : in_world_[static_cast<std::size_t>(link.parent)];
      in_world_.push_back(inboard * link.place.X);
    }
    for (const XmlElement& e : root_.children)
      if (e.name == "equality")
        for (const XmlElement& one : e.children) read_equality(one);
    return std::move(robot_);
  }

 private:
  bool yes(const XmlView& v, std::string_view attribute, bool otherwise) {
    const XmlAttribute* a = v.find(attribute);
    if (!a || a->value == "auto") return otherwise;
    if (a->value != "true" && a->value != "false")
      source_.sink.report(Code::wrong_type, {path_of(v.element, attribute), a->mark}, "true or false", in_quotes(a->value));
    return a->value == "true";
  }

  // ---- what holds for the whole file ----

  void read_compiler(const XmlElement& e) {
    source_.expect_attributes(
        e, "angle coordinate eulerseq autolimits inertiafromgeom boundmass boundinertia settotalmass balanceinertia inertiagrouprange",
        "meshdir texturedir assetdir strippath discardvisual convexhull usethread fusestatic fitaabb alignfree saveinertial "
        "exactmeshinertia conflict");
    const XmlView v{e};
    const auto word = [&](const char* name, const std::vector<std::string>& legal) -> std::string {
      const XmlAttribute* a = v.find(name);
      if (!a) return {};
      for (const std::string& one : legal)
        if (a->value == one) return one;
      source_.report(Code::not_imported, e, name, fmt::format("{}", fmt::join(legal, ", ")), in_quotes(a->value));
      return {};
    };
    if (const std::string angle = word("angle", {"degree", "radian"}); !angle.empty()) degree_ = angle == "radian" ? 1.0 : kPi / 180;
    word("coordinate", {"local"});
    if (const XmlAttribute* a = v.find("eulerseq")) {
      euler_ = a->value;
      if (euler_.size() != 3 || euler_.find_first_not_of("xyzXYZ") != std::string::npos) {
        source_.report(Code::wrong_type, e, "eulerseq", "three of x, y, z, X, Y, Z", in_quotes(a->value));
        euler_ = "xyz";
      }
    }
    autolimits_ = yes(v, "autolimits", autolimits_);
    if (const std::string from = word("inertiafromgeom", {"auto", "true", "false"}); !from.empty()) from_geom_ = from;
    for (const char* name : {"boundmass", "boundinertia"})
      if (v.find(name) && source_.number(v, name, 0.0) != 0.0) source_.cannot(e, name, "masses and inertias as they are given");
    if (v.find("settotalmass") && source_.number(v, "settotalmass", -1.0) > 0)
      source_.cannot(e, "settotalmass", "masses as they are given");
    if (yes(v, "balanceinertia", false)) source_.cannot(e, "balanceinertia", "inertias as they are given");
    if (v.find("inertiagrouprange")) source_.cannot(e, "inertiagrouprange", "inertia from all geoms of a body");
  }

  void read_option(const XmlElement& e) {
    source_.expect_attributes(
        e, "gravity density viscosity wind",
        "timestep apirate impratio tolerance ls_tolerance noslip_tolerance mpr_tolerance ccd_tolerance sleep_tolerance magnetic "
        "o_margin o_solref o_solimp o_friction integrator collision cone jacobian solver iterations ls_iterations "
        "noslip_iterations mpr_iterations ccd_iterations sdf_iterations sdf_initpoints actuatorgroupdisable");
    const XmlView v{e};
    robot_.gravity = source_.vector(v, "gravity", robot_.gravity);
    for (const char* name : {"density", "viscosity"})
      if (source_.number(v, name, 0.0) != 0.0) source_.cannot(e, name, "motion in a void: forces of a fluid are devices of the vehicle");
    for (const XmlElement& flag : e.children) {
      if (flag.name != "flag") {
        source_.cannot(flag, flag.name, "flag");
        continue;
      }
      source_.expect_attributes(flag, "gravity constraint equality frictionloss limit passive spring damper",
                                "contact actuation clampctrl warmstart filterparent refsafe sensor midphase nativeccd eulerdamp autoreset "
                                "override energy fwdinv invdiscrete multiccd island sleep");
      for (const XmlAttribute& a : flag.attributes) {
        if (!is_word_of("enable disable", a.value)) {
          source_.report(Code::wrong_type, flag, a.name, "enable or disable", in_quotes(a.value));
          continue;
        }
        if (a.name == "gravity" && a.value == "disable") no_gravity_ = true;
        if (is_word_of("constraint equality frictionloss limit passive spring damper", a.name) && a.value == "disable")
          source_.cannot(flag, a.name, "what the file describes, switched on");
      }
    }
  }

  /// A class of defaults and those in it.
  void read_default(const XmlElement& e, const XmlDefaults* parent) {
    const XmlAttribute* name = e.attribute("class");
    XmlDefaults* here = parent ? nullptr : classes_.at("main");
    if (!here) {
      here = &all_classes_.emplace_back();
      here->parent = parent;
      if (!name)
        source_.report(Code::missing_key, e, "class", "class: a text", "no such attribute");
      else if (!classes_.emplace(name->value, here).second)
        source_.report(Code::duplicate_name, e, "class", "a name of its own for each class", in_quotes(name->value));
    } else if (name) {
      classes_.emplace(name->value, here);
    }
    for (const XmlElement& child : e.children) {
      if (child.name == "default") continue;
      if (child.name == "joint") source_.expect_attributes(child, kJoint, kJointIgnored);
      if (child.name == "geom") source_.expect_attributes(child, kGeom, kGeomIgnored);
      if (child.name == "site") source_.expect_attributes(child, kSite, kSiteIgnored);
      if (child.name == "geom" || child.name == "site") one_orientation(child);
      if (!is_word_of("joint geom site equality mesh material camera light pair tendon general motor position velocity intvelocity damper "
                      "cylinder muscle adhesion dcmotor plugin",
                      child.name))
        cannot_be_here(child, "elements that have defaults: joint, geom, site, ...");
      if (!here->elements.emplace(child.name, &child).second)
        source_.report(Code::duplicate_key, child, {}, fmt::format("one {} in a class", child.name), "a second");
    }
    for (const XmlElement& child : e.children)
      if (child.name == "default") read_default(child, here);
  }

  void cannot_be_here(const XmlElement& e, const char* legal) {
    source_.cannot(e, e.name, legal, e.name == "include" ? "put the file in its place" : "");
  }

  void read_section(const XmlElement& e) {
    if (is_word_of("compiler option default equality", e.name)) return;
    if (e.name == "worldbody") {
      source_.expect_attributes(e, "childclass");
      const XmlDefaults* defaults = class_of(e, "childclass", classes_.at("main"));
      for (const XmlElement& child : e.children) {
        if (child.name == "body")
          read_body(child, -1, defaults);
        else if (child.name == "site")
          read_site(child, -1, defaults);
        else if (is_word_of("geom light camera", child.name))
          source_.leave(child.name);
        else
          cannot_be_here(child, "body, site, geom, light, camera");
      }
    } else if (e.name == "tendon" || e.name == "deformable") {
      if (!e.children.empty()) source_.cannot(e, e.name, "joints, connect, weld and joint equalities");
    } else if (is_word_of("actuator contact", e.name)) {
      for (const XmlElement& child : e.children)
        if (child.name == "include")
          cannot_be_here(child, "elements of MJCF");
        else
          source_.leave_force(e.name + " " + child.name);
    } else if (e.name == "sensor") {
      for (const XmlElement& child : e.children) source_.leave(e.name + " " + child.name);
    } else if (is_word_of("size statistic visual asset keyframe custom", e.name)) {
      source_.leave(e.name);
    } else {
      cannot_be_here(e, "sections of MJCF");
    }
  }

  // ---- poses ----

  RobotPlace read_place(const XmlView& v) {
    RobotPlace out;
    out.X.p = source_.vector(v, "pos", Vec3<double>{});
    out.X.R = read_rotation(v);
    return out;
  }

  void one_orientation(const XmlElement& e) {
    if (std::ranges::count_if(e.attributes, [](const XmlAttribute& a) { return is_word_of(kOrientations, a.name); }) > 1)
      source_.report(Code::duplicate_key, e, {}, "one of quat, axisangle, euler, xyaxes, zaxis", "several");
  }

  /// Where `fromto` lays an element: in the middle, its z axis from the second end to the first; half its length. None without it.
  std::optional<std::pair<Pose<double>, double>> read_ends_of(const XmlView& v) {
    if (!v.find("fromto")) return std::nullopt;
    const XmlAttribute* type = v.find("type");
    if (!type || !is_word_of("capsule cylinder ellipsoid box", type->value))
      source_.report(Code::not_imported, v.element, "fromto", "fromto of a capsule, cylinder, ellipsoid or box",
                     fmt::format("of a {}", type ? type->value : "sphere"));
    if (length(source_.vector(v, "pos", Vec3<double>{})) > 0)
      source_.report(Code::duplicate_key, v.element, "fromto", "fromto, or pos", "both");
    const auto f = source_.numbers(v, "fromto", 6, nullptr);
    const Vec3<double> a{f[0], f[1], f[2]}, b{f[3], f[4], f[5]}, d = a - b;
    if (!(length(d) > 1e-10)) {
      source_.report(Code::out_of_range, v.element, "fromto", "two places", "one place");
      return std::nullopt;
    }
    return {{{rotation_of_z_to(d), 0.5 * (a + b)}, 0.5 * length(d)}};
  }

  Mat3<double> read_rotation(const XmlView& v) {
    const auto about = [](const Vec3<double>& u, double q) { return rotation_about(u, std::sin(q), std::cos(q)); };
    const auto zero = [&](const char* name) {
      source_.report(Code::out_of_range, v.element, name, "a vector that is not zero", "zero");
      return Mat3<double>::identity();
    };
    const auto unit = [](const Vec3<double>& a) { return 1.0 / length(a) * a; };
    one_orientation(v.element);
    // MuJoCo takes the other forms before quat, one of a class too.
    const XmlAttribute* other = v.find("axisangle euler xyaxes zaxis");
    const std::string_view form = other ? std::string_view(other->name) : v.find("quat") ? "quat" : "";
    if (form == "quat") {
      const auto q = source_.numbers(v, "quat", 4, nullptr);
      if (!(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] > 1e-20)) return zero("quat");
      return rotation_of_quaternion(q[0], q[1], q[2], q[3]);
    }
    if (form == "axisangle") {
      const auto a = source_.numbers(v, "axisangle", 4, nullptr);
      const Vec3<double> u{a[0], a[1], a[2]};
      if (!(length(u) > 1e-10)) return zero("axisangle");
      return about(unit(u), a[3] * degree_);
    }
    if (form == "euler") {
      const Vec3<double> a = degree_ * source_.vector(v, "euler", std::nullopt);
      const double angles[] = {a.x, a.y, a.z};
      Mat3<double> R = Mat3<double>::identity();
      for (std::size_t i = 0; i < 3; ++i) {
        const char axis = static_cast<char>(euler_[i] | 0x20);
        const Mat3<double> one = about({axis == 'x' ? 1.0 : 0.0, axis == 'y' ? 1.0 : 0.0, axis == 'z' ? 1.0 : 0.0}, angles[i]);
        R = axis == euler_[i] ? R * one : one * R;  // small letters: about the moved axes
      }
      return R;
    }
    if (form == "xyaxes") {
      const auto a = source_.numbers(v, "xyaxes", 6, nullptr);
      const Vec3<double> x0{a[0], a[1], a[2]}, y0{a[3], a[4], a[5]};
      if (!(length(x0) > 1e-10)) return zero("xyaxes");
      const Vec3<double> x = unit(x0), y1 = y0 - dot(x, y0) * x;
      if (!(length(y1) > 1e-10)) return zero("xyaxes");
      const Vec3<double> y = unit(y1), z = cross(x, y);
      return {x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z};
    }
    if (form == "zaxis") {
      const Vec3<double> z = source_.vector(v, "zaxis", std::nullopt);
      if (!(length(z) > 1e-10)) return zero("zaxis");
      return rotation_of_z_to(z);
    }
    return Mat3<double>::identity();
  }

  // ---- bodies ----

  const XmlDefaults* class_of(const XmlElement& e, std::string_view attribute, const XmlDefaults* otherwise) {
    const XmlAttribute* a = e.attribute(attribute);
    if (!a) return otherwise;
    const auto found = classes_.find(a->value);
    if (found != classes_.end()) return found->second;
    source_.report(Code::unknown_name, e, attribute, "the name of a class of defaults", in_quotes(a->value));
    return otherwise;
  }

  template <class Names>
  void take_name(const XmlElement& e, Names& names, typename Names::mapped_type value) {
    if (const std::string name(e.called()); !name.empty() && !names.emplace(name, std::move(value)).second)
      source_.report(Code::duplicate_name, e, "name", fmt::format("a name of its own for each {}", e.name), in_quotes(name));
  }

  void read_body(const XmlElement& e, int parent, const XmlDefaults* defaults) {
    source_.expect_attributes(e, "name childclass mocap pos quat axisangle xyaxes zaxis euler gravcomp", "user sleep");
    defaults = class_of(e, "childclass", defaults);
    const int here = static_cast<int>(robot_.links.size());
    take_name(e, bodies_, here);
    RobotLink link;
    link.what = "body";
    link.name = e.called().empty() ? fmt::format("body_{}", here + 1) : std::string(e.called());
    link.mark = e.mark;
    link.parent = parent;
    link.place = read_place({e});
    if (yes({e}, "mocap", false)) source_.cannot(e, "mocap", "a body on hinges");
    if (source_.number({e}, "gravcomp", 0.0) != 0.0) source_.cannot(e, "gravcomp", "gravity on every body alike");
    const XmlElement* inertial = nullptr;
    std::vector<const XmlElement*> geoms;
    for (const XmlElement& child : e.children) {
      if (child.name == "inertial") {
        if (inertial) source_.report(Code::duplicate_key, child, {}, "one inertial", "a second");
        inertial = &child;
      } else if (child.name == "joint" || child.name == "freejoint") {
        if (auto joint = read_joint(child, parent, class_of(child, "class", defaults))) link.joints.push_back(std::move(*joint));
      } else if (child.name == "geom") {
        geoms.push_back(&child);
      } else if (is_word_of("light camera", child.name)) {
        source_.leave(child.name);
      } else if (child.name != "body" && child.name != "site") {
        cannot_be_here(child, "inertial, joint, freejoint, geom, site, camera, light, body");
      }
    }
    if (inertial && (from_geom_ != "true" || geoms.empty()))
      link.inertial = read_inertial(*inertial);
    else if (from_geom_ != "false")
      link.inertial = inertia_of(geoms, e, defaults);
    if (link.inertial && link.inertial->mass == 0.0 && !inertial) link.inertial.reset();
    if (!geoms.empty() && (!link.inertial || link.inertial->from.empty()))
      for (std::size_t i = 0; i < geoms.size(); ++i) source_.leave("geom");
    robot_.links.push_back(std::move(link));
    for (const XmlElement& child : e.children) {
      if (child.name == "body") read_body(child, here, defaults);
      if (child.name == "site") read_site(child, here, defaults);
    }
  }

  void read_site(const XmlElement& e, int link, const XmlDefaults* defaults) {
    source_.expect_attributes(e, kSite, kSiteIgnored);
    const XmlView v{e, class_of(e, "class", defaults)};
    RobotSite site{std::string(e.called()), "site", read_place(v), e.mark};
    if (const auto ends = read_ends_of(v)) site.place.X = ends->first;
    take_name(e, sites_, {link, site.place});
    if (link < 0 || site.name.empty())
      source_.leave("site");
    else
      robot_.links[static_cast<std::size_t>(link)].sites.push_back(std::move(site));
  }

  RobotInertial read_inertial(const XmlElement& e) {
    source_.expect_attributes(e, "pos mass diaginertia fullinertia quat axisangle xyaxes zaxis euler");
    const XmlView v{e};
    const RobotPlace place = read_place(v);
    if (!v.find("pos")) source_.report(Code::missing_key, e, "pos", "pos: 3 numbers", "no such attribute");
    RobotInertial out;
    out.mass = source_.number(v, "mass", std::nullopt);
    out.com = place.X.p;
    out.mass_mark = out.inertia_mark = e.mark;
    if (v.find("fullinertia") && (v.find("diaginertia") || v.find(kOrientations)))
      source_.report(Code::duplicate_key, e, "fullinertia", "fullinertia alone, or diaginertia with or without an orientation", "both");
    Sym3<double> J;
    if (v.find("fullinertia")) {
      const auto f = source_.numbers(v, "fullinertia", 6, nullptr);
      J = {f[0], f[1], f[2], f[3], f[4], f[5]};
    } else {
      const Vec3<double> d = source_.vector(v, "diaginertia", std::nullopt);
      J = {d.x, d.y, d.z, 0, 0, 0};
    }
    out.J = rotate(place.X.R, J);
    return out;
  }

  std::optional<RobotJoint> read_joint(const XmlElement& e, int parent, const XmlDefaults* defaults) {
    source_.expect_attributes(e, kJoint, kJointIgnored);
    const XmlView v{e, e.name == "joint" ? defaults : nullptr};
    static const std::map<std::string, Kind, std::less<>> kinds{
        {"hinge", Kind::hinge}, {"slide", Kind::slide}, {"ball", Kind::ball}, {"free", Kind::free}};
    RobotJoint j;
    if (e.name == "freejoint") {
      j.kind = Kind::free;
    } else if (const XmlAttribute* type = v.find("type")) {
      const auto found = kinds.find(type->value);
      if (found == kinds.end()) {
        source_.report(Code::not_imported, e, "type", "hinge, slide, ball, free", in_quotes(type->value));
        return std::nullopt;
      }
      j.kind = found->second;
    }
    if (j.kind == Kind::free && parent >= 0)
      source_.report(Code::not_imported, e, {}, "a free joint of a body of the world", "one of a body on another");
    j.id = robot_.n_joints++;
    j.name = std::string(e.called());
    j.mark = j.axis_mark = e.mark;
    const bool one = j.kind == Kind::hinge || j.kind == Kind::slide;
    const double unit = j.kind == Kind::hinge ? degree_ : 1.0;
    j.axis = source_.vector(v, "axis", Vec3<double>{0, 0, 1});
    if (j.kind != Kind::free) j.point = source_.vector(v, "pos", Vec3<double>{});
    const double ref = unit * source_.number(v, "ref", 0.0);
    j.stiffness = source_.number(v, "stiffness", 0.0);
    j.damping = source_.number(v, "damping", 0.0);
    j.friction = source_.number(v, "frictionloss", 0.0);
    j.rest = j.stiffness == 0.0 ? 0.0 : unit * source_.number(v, "springref", 0.0) - ref;
    if (ref != 0.0) j.remark = fmt::format("counted from its ref, {}", ref);
    if (source_.number(v, "armature", 0.0) != 0.0)
      source_.cannot(e, "armature", "joints without added inertia", "a rotor is a body of its own, geared by a coupling");
    if (v.find("springdamper")) {
      const auto sd = source_.numbers(v, "springdamper", 2, nullptr);
      if (sd[0] > 0 && sd[1] > 0) source_.cannot(e, "springdamper", "stiffness and damping");
    }
    if (!one && j.stiffness != 0.0 && source_.cannot(e, "stiffness", "springs of joints with one coordinate")) j.stiffness = 0.0;
    if (!one && j.friction != 0.0 && source_.cannot(e, "frictionloss", "friction of joints with one coordinate")) j.friction = 0.0;
    if (yes(v, "limited", autolimits_ && v.find("range"))) {
      const auto range = source_.numbers(v, "range", 2, nullptr);
      if (one) {
        j.lower = unit * range[0] - ref;
        j.upper = unit * range[1] - ref;
        if (!(*j.lower <= *j.upper))
          source_.report(Code::out_of_range, e, "range", "two numbers, the smaller first", fmt::format("{:g} {:g}", range[0], range[1]));
      } else {
        source_.leave("range of a ball joint");
      }
    }
    take_name(e, joints_, {j.id, one});
    return j;
  }

  // ---- inertia from geoms ----

  std::optional<RobotInertial> inertia_of(const std::vector<const XmlElement*>& geoms, const XmlElement& body,
                                          const XmlDefaults* defaults) {
    std::vector<GeomMass> masses;
    for (const XmlElement* e : geoms)
      if (const auto one = mass_of(*e, {*e, class_of(*e, "class", defaults)})) masses.push_back(*one);
    if (masses.empty()) return std::nullopt;
    RobotInertial out;
    out.mass_mark = out.inertia_mark = body.mark;
    out.from = masses.size() == 1 ? "one geom" : fmt::format("{} geoms", masses.size());
    for (const GeomMass& g : masses) out.mass += g.mass, out.com += g.mass * g.com;
    if (!(out.mass > 0)) return out;
    out.com = 1.0 / out.mass * out.com;
    for (const GeomMass& g : masses) {
      const Vec3<double> d = g.com - out.com;
      const double m = g.mass, dd = dot(d, d);
      out.J += g.J + Sym3<double>{m * (dd - d.x * d.x), m * (dd - d.y * d.y), m * (dd - d.z * d.z),
                                  -m * d.x * d.y,       -m * d.x * d.z,       -m * d.y * d.z};
    }
    return out;
  }

  std::optional<GeomMass> mass_of(const XmlElement& e, const XmlView& v) {
    source_.expect_attributes(e, kGeom, kGeomIgnored);
    const XmlAttribute* given = v.find("mass");
    const double density = source_.number(v, "density", 1000.0);
    if (const char* counts = given ? "mass" : "density"; source_.number(v, counts, 0.0) < 0) {
      source_.report(Code::out_of_range, e, counts, "a number that is not negative", fmt::format("{:g}", source_.number(v, counts, 0.0)));
      return std::nullopt;
    }
    if (given ? source_.number(v, "mass", 0.0) == 0.0 : density == 0.0) return std::nullopt;
    const XmlAttribute* t = v.find("type");
    const std::string type = t ? t->value : v.find("mesh") ? "mesh" : "sphere";
    if (type == "plane" || type == "hfield") return std::nullopt;  // which have no mass
    static const std::map<std::string, std::size_t> sizes{{"sphere", 1}, {"capsule", 2}, {"cylinder", 2}, {"ellipsoid", 3}, {"box", 3}};
    const auto found = sizes.find(type);
    if (found == sizes.end()) {
      source_.cannot(e, type, "a body with inertial, or geoms of type sphere, capsule, cylinder, ellipsoid, box");
      return std::nullopt;
    }
    if (v.find("mesh")) {
      source_.cannot(e, "mesh", "a geom of its own size: one that is fitted to a mesh has that of the mesh");
      return std::nullopt;
    }
    if (yes(v, "shellinertia", false) && !source_.cannot(e, "shellinertia", "solid geoms")) return std::nullopt;
    Pose<double> place;
    std::vector<double> s;
    if (const auto ends = read_ends_of(v)) {
      place = ends->first;
      const auto r = source_.numbers(v, "size", 1, nullptr, 3);
      s = found->second == 2 ? std::vector<double>{r[0], ends->second} : std::vector<double>{r[0], r[0], ends->second};
    } else {
      place = read_place(v).X;
      s = source_.numbers(v, "size", found->second, nullptr, 3);
    }
    for (std::size_t i = 0; i < found->second; ++i)
      if (!(s[i] > 0)) {
        source_.report(Code::out_of_range, e, "size", "sizes > 0", fmt::format("{:g}", s[i]));
        return std::nullopt;
      }
    // Volume, and the moments of a unit of mass.
    double volume = 0.0;
    Vec3<double> k;
    const double r = s[0], h = s.size() > 1 ? s[1] : 0.0;  // h: half a length
    if (type == "sphere") {
      volume = 4.0 / 3 * kPi * r * r * r;
      k = {0.4 * r * r, 0.4 * r * r, 0.4 * r * r};
    } else if (type == "cylinder") {
      volume = 2 * kPi * r * r * h;
      k = {r * r / 4 + h * h / 3, r * r / 4 + h * h / 3, r * r / 2};
    } else if (type == "capsule") {
      const double middle = 2 * kPi * r * r * h, ends = 4.0 / 3 * kPi * r * r * r;
      volume = middle + ends;
      const double across = (middle * (r * r / 4 + h * h / 3) + ends * (0.4 * r * r + h * h + 0.75 * r * h)) / volume;
      k = {across, across, (middle * 0.5 + ends * 0.4) * r * r / volume};
    } else {
      const double a = s[0] * s[0], b = s[1] * s[1], c = s[2] * s[2], f = type == "box" ? 1.0 / 3 : 0.2;
      volume = (type == "box" ? 8.0 : 4.0 / 3 * kPi) * s[0] * s[1] * s[2];
      k = {f * (b + c), f * (a + c), f * (a + b)};
    }
    const double mass = given ? source_.number(v, "mass", 0.0) : density * volume;
    return GeomMass{mass, place.p, rotate(place.R, Sym3<double>{mass * k.x, mass * k.y, mass * k.z, 0, 0, 0})};
  }

  // ---- equalities ----

  template <class Names>
  const typename Names::mapped_type* named(const XmlElement& e, const char* attribute, const char* what, const Names& names) {
    const std::string name = source_.text({e}, attribute);
    if (name.empty()) return nullptr;
    const auto found = names.find(name);
    if (found != names.end()) return &found->second;
    if (source_.sink.full()) return nullptr;
    std::vector<std::string> legal;
    for (const auto& [known, value] : names)
      if (legal.size() < 1000) legal.push_back(known);
    source_.report(Code::unknown_name, e, attribute, fmt::format("the name of a {}", what), in_quotes(name), did_you_mean(name, legal));
    return nullptr;
  }

  void read_equality(const XmlElement& e) {
    const XmlView v{e, class_of(e, "class", classes_.at("main")), "equality"};
    if (!is_word_of("connect weld joint", e.name)) {
      source_.cannot(e, e.name, "connect, weld, joint");
      return;
    }
    if (source_.asked_to_leave_out("equality", e.called())) return;
    source_.expect_attributes(e,
                              e.name == "joint"     ? "name class active joint1 joint2 polycoef"
                              : e.name == "connect" ? "name class active body1 body2 anchor site1 site2"
                                                    : "name class active body1 body2 relpose anchor site1 site2 torquescale",
                              "solref solimp");
    if (!yes(v, "active", true)) return source_.leave("equality that is not active");
    RobotClosure c;
    c.name = std::string(e.called());
    c.what = "equality " + e.name;
    c.mark = e.mark;
    const std::size_t before = source_.sink.all().size();
    if (e.name == "joint")
      read_joint_equality(e, c);
    else
      read_ends(e, c);
    if (source_.sink.all().size() == before) robot_.closures.push_back(std::move(c));
  }

  void read_ends(const XmlElement& e, RobotClosure& c) {
    c.type = e.name == "connect" ? "point" : "weld";
    // A weld that does not care for rotations holds its anchor alone.
    const bool turns = c.type == "weld" && source_.number({e}, "torquescale", 1.0) != 0.0;
    if (e.attribute("site1") || e.attribute("site2")) {
      const auto *a = named(e, "site1", "site", sites_), *b = named(e, "site2", "site", sites_);
      if (a && b) c.from = {a->first, a->second}, c.to = {b->first, b->second};
      if (!turns) c.type = "point";
      return;
    }
    const int* a = named(e, "body1", "body", bodies_);
    const int* b = e.attribute("body2") ? named(e, "body2", "body", bodies_) : nullptr;
    if (!a || (!b && e.attribute("body2"))) return;
    c.from.link = *a;
    c.to.link = b ? *b : -1;
    const auto in_world = [&](int k) { return k < 0 ? Pose<double>{} : in_world_[static_cast<std::size_t>(k)]; };
    const Pose<double> of_a = in_world(c.from.link), of_b = in_world(c.to.link);
    if (c.type == "point") {
      const Pose<double> anchor{Mat3<double>::identity(), source_.vector({e}, "anchor", std::nullopt)};
      c.from.place.X = anchor;
      c.to.place.X.p = (inverse(of_b) * of_a * anchor).p;
      return;
    }
    const std::vector<double> none(7, 0.0), pose = source_.numbers({e}, "relpose", 7, &none);
    if (pose[3] == 0 && pose[4] == 0 && pose[5] == 0 && pose[6] == 0)
      c.from.place.X = inverse(of_a) * of_b;
    else
      c.from.place.X = {rotation_of_quaternion(pose[3], pose[4], pose[5], pose[6]), {pose[0], pose[1], pose[2]}};
    if (turns) return;
    c.type = "point";
    c.to.place.X.p = source_.vector({e}, "anchor", Vec3<double>{});
    c.from.place.X = c.from.place.X * c.to.place.X;
  }

  void read_joint_equality(const XmlElement& e, RobotClosure& c) {
    c.type = "coupling";
    const auto one = [&](const char* attribute) -> const std::pair<int, bool>* {
      const auto* j = named(e, attribute, "joint", joints_);
      if (!j || j->second) return j;
      source_.report(Code::not_imported, e, attribute, "a joint with one coordinate", "one with several");
      return nullptr;
    };
    const std::vector<double> same{0, 1, 0, 0, 0};
    std::vector<double> k = source_.numbers({e}, "polycoef", 1, &same, 5);
    if (k.size() == 1) k.push_back(1.0);
    const auto* first = one("joint1");
    const auto* second = e.attribute("joint2") ? one("joint2") : nullptr;
    if (!first) return;
    c.terms = {{first->first, 1.0}};
    c.dependent = first->first;
    c.offset = k[0];
    if (!second) return;
    if (second->first == first->first) {
      source_.report(Code::cycle, e, "joint2", "another joint", in_quotes(e.attribute("joint2")->value));
      return;
    }
    if (std::ranges::any_of(k.begin() + 2, k.end(), [](double x) { return x != 0.0; })) {
      while (k.back() == 0.0) k.pop_back();
      c.offset = 0.0;
      c.polynomial = std::move(k), c.of = second->first;
    } else if (k.size() > 1 && k[1] != 0.0) {
      c.terms.emplace_back(second->first, -k[1]);
    }
  }

 public:
  bool no_gravity() const { return no_gravity_; }

 private:
  const XmlElement& root_;
  RobotSource& source_;
  Robot robot_;
  std::list<XmlDefaults> all_classes_;
  std::map<std::string, XmlDefaults*, std::less<>> classes_;
  std::map<std::string, int, std::less<>> bodies_;
  std::map<std::string, std::pair<int, bool>, std::less<>> joints_;  // id; of one coordinate
  std::map<std::string, std::pair<int, RobotPlace>, std::less<>> sites_;
  std::vector<Pose<double>> in_world_;
  double degree_ = kPi / 180;  // what an angle of the file is multiplied by
  std::string euler_ = "xyz", from_geom_ = "auto";
  bool autolimits_ = true, no_gravity_ = false;
};

}  // namespace

Robot read_mjcf(const XmlElement& root, RobotSource& source) {
  MjcfReader reader(root, source);
  Robot out = reader.read();
  if (reader.no_gravity()) out.gravity = Vec3<double>{};
  return out;
}

}  // namespace cardan
