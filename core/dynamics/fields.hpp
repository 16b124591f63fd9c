#pragma once
// The fields of a model at one time, and what devices read of them where they are mounted.
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/model/model.hpp"

namespace cardan {

/// What fields prepare for a time, once for each time.
class FieldMoments {
 public:
  explicit FieldMoments(const Model& model);
  /// Of a field at t [s]; its `prepared` is overwritten by the next call for the same field.
  const FieldMoment& at(int field, double t);
  std::size_t bytes() const;

 private:
  struct One {
    FieldMoment moment;
    std::vector<double> prepared;
    bool known = false;
  };
  const Model& model_;
  std::vector<One> all_;
};

/// A copy of a moment of gravity that is a field; null where it is none.
std::shared_ptr<const FieldMoment> kept_moment(const Model& model, const FieldMoment* at);

/// Of GravitySpec::Kind::field: the index of the field; else -1.
int field_of_gravity(const Model& model);

/// "air", of a plugin "air (acme/air, ./acme.so)".
std::string told_name(const Field& field);

/// "air is asked beyond its limit altitude: below the ground"; empty where `beyond` has no limit that is refused.
std::string told_beyond(const Field& field, int beyond);

/// "air is beyond its limit altitude and holds: ..."
std::string held_text(const Field& field, int beyond);

/// What went wrong where fields are asked for devices.
struct FieldFault {
  int device = -1;  // index into Devices::all; -1: nothing
  std::string what;
};

/// What the mounts of devices read of fields: one call for all points of a field.
class FieldsOfDevices {
 public:
  explicit FieldsOfDevices(const Model& model);
  bool empty() const { return groups_.empty(); }
  /// Into cardan_mount_motion::field, at t [s], where the nodes of `motions` are now. `in_steps`: of mounts that are read inside of steps,
  /// or of the others. False: beyond what a field knows, or no number. Beyond a limit that is refused but could be held the value is that
  /// of its end, and passed_limit() tells: a step that is tried may go there, a motion may not.
  bool look(double t, bool in_steps, std::vector<cardan_mount_motion>& motions, FieldFault& fault);
  /// Of Devices::edges, Devices::n_edges numbers, where the nodes of `motions` are now.
  void edges(double t, const std::vector<cardan_mount_motion>& motions, double* g);
  /// The derivative of that into `rates`, along the rates of the nodes that stand there.
  void look_along(double t, bool in_steps, const std::vector<cardan_mount_motion>& motions, std::vector<cardan_mount_motion>& rates);
  /// Index of the field whose function threw, if one did; else -1.
  int asked() const { return asked_; }
  /// Of the last look(), and of any that has failed at a limit; null: none.
  const FieldFault* passed_limit() const { return passed_.device >= 0 ? &passed_ : nullptr; }
  const FieldFault* tried_limit() const { return stopped_.device >= 0 ? &stopped_ : nullptr; }
  /// A step that was tried went beyond a limit, and a smaller one did not.
  void forget_limit() { stopped_.device = -1; }
  /// Bits of limits beyond which a field held its value in the last evaluation, by field.
  const std::vector<int>& held() const { return held_; }
  /// visit(index of the field, its moment, how many points, the points): where fields are asked when nodes are as in `motions`.
  using Visit = std::function<void(int, const FieldMoment&, int, const double*)>;
  void visit(double t, const std::vector<cardan_mount_motion>& motions, const Visit& visit);
  std::size_t bytes() const;

 private:
  struct Reader {
    int device, mount, node;  // mounts: indices into motions; node = -1: of what is of time alone
  };
  struct Group {
    int field = 0;
    bool in_steps = true;
    std::vector<Reader> readers;
  };
  int ask(const Group& group, double t, const std::vector<cardan_mount_motion>& motions, bool gradients);
  int place(const Group& group, const std::vector<cardan_mount_motion>& motions);
  int first_beyond(const Group& group, double t);

  const Model& model_;
  FieldMoments moments_;
  std::vector<Group> groups_;
  FieldFault passed_, stopped_;
  int asked_ = -1;
  std::vector<int> held_;
  std::vector<double> points_, values_, gradients_;
};

}  // namespace cardan
