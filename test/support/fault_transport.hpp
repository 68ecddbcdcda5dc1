// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <ostream>

namespace cles::test {

/// How the chosen step fails.
enum class fault : std::uint8_t {
    lost,  ///< the link is lost there; a dial is refused
    cut,   ///< the first half of what is written there arrives, and then the link is lost
    ended, ///< the peer seems to end its side; it goes on writing, so a link that is kept is lost soon after
};

std::ostream& operator<<(std::ostream& out, fault kind);

/// Selects the step that fails, of all links `fault://name`. These are like `inproc`, on one thread. Steps are: a dial,
/// an accepted link, the start of an end, a flush, and the delivery of a line.
class fault_plan {
  public:
    static fault_plan& instance();

    /// Starts to count, and lets the step with this number (from 0) fail.
    void arm(fault how, int step);
    void disarm() { arm(fault::lost, -1); }
    /// Whether the current step fails.
    bool strikes();

    [[nodiscard]] fault how() const noexcept { return how_; }
    /// Whether the step has been reached.
    [[nodiscard]] bool struck() const noexcept { return struck_; }
    /// The number of existing link ends.
    [[nodiscard]] int links() const noexcept { return links_; }

  private:
    friend class faulty_link;

    fault how_ = fault::lost;
    int step_ = -1;
    int count_ = 0;
    bool struck_ = false;
    int links_ = 0;
};

/// Registers the scheme `fault`. Idempotent.
void register_fault_transport();

} // namespace cles::test
