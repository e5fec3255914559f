#pragma once

#include <map>
#include <string>

#include "runtime/api/handles.h"
#include "runtime/sim/world/world.h"

// NOLINTBEGIN(readability-identifier-naming): its name is the API's.

struct exmat_world {
  /// A body of it, at the same place as in `world`.
  struct Member {
    std::int64_t id = 0;
    std::string name;
    std::unique_ptr<exmat_body> body;
    std::int64_t kind = -1;  ///< in the scene
  };

  exmat_world(const exmat::runtime::ContactLaw& its_law, bool meets_itself)
      : law(its_law), self(meets_itself), world(its_law) {}

  exmat::runtime::ContactLaw law;
  bool self;
  exmat::runtime::World world;
  std::vector<Member> members;  ///< in ascending order of ids
  std::int64_t next_id = 0;
  std::vector<exmat_body_contact> contacts;  ///< at the end of the last step
  /// Of the models whose bodies were ever in it.
  std::map<std::shared_ptr<const exmat::runtime::Source>, std::shared_ptr<const exmat::runtime::TouchingSurface>>
      surfaces;
};

// NOLINTEND(readability-identifier-naming)

namespace exmat::runtime {

/// A body was put elsewhere: where it is in a world, that forgets what it touched.
void was_put(exmat_body& body) noexcept;

/// Takes a body out of its world, which no longer owns it.
void leave_world(exmat_body& body) noexcept;

/// Adds a body that the world owns from now on. Where it throws, nothing has changed.
std::int64_t join(exmat_world& world, const std::shared_ptr<const TouchingSurface>& surface, std::string name,
                  exmat_body& body);

}  // namespace exmat::runtime
