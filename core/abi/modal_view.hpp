#pragma once
// Modal data as a body family is handed them (cardan_modal_view).
#include "core/abi/cardan_body.h"
#include "core/spatial/modal_data.hpp"

namespace cardan {

/// Holds the arrays that the view points to; `data` must outlive it.
class ModalView {
 public:
  ModalView(const ModalData& data, int level);
  ModalView(const ModalView&) = delete;
  ModalView& operator=(const ModalView&) = delete;

  const cardan_modal_view* get() const { return &view_; }

 private:
  std::vector<double> I5_, I8_, I9_, ww_, we_, ee_, mass_, position_, inertia_, Phi_, Psi_, Q_, shapes_;
  std::vector<cardan_modal_node> nodes_;
  cardan_modal_view view_{};
};

}  // namespace cardan
