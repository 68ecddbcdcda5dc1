// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <ostream>

namespace cles::test {

/// How the step that is to fail fails.
enum class fault : std::uint8_t {
    lost,  ///< the link is lost there; a dial is refused
    cut,   ///< of what is written there, the first half arrives, and then the link is lost
    ended, ///< the peer seems to end its side there; since it goes on writing, a link that is kept is lost soon after
};

std::ostream& operator<<(std::ostream& out, fault kind);

/// Which step of all links `fault://name` fails. These are like `inproc`, on one thread; steps are: a dial, a link that
/// comes in, the start of an end, a flush, and a line that is handed over.
class fault_plan {
  public:
    static fault_plan& instance();

    /// Counts from now on, and lets the step with this number (from 0) fail.
    void arm(fault how, int step);
    void disarm() { arm(fault::lost, -1); }
    /// Whether the step that comes now fails.
    bool strikes();

    [[nodiscard]] fault how() const noexcept { return how_; }
    /// Whether the step has come.
    [[nodiscard]] bool struck() const noexcept { return struck_; }
    /// Ends of links that exist.
    [[nodiscard]] int links() const noexcept { return links_; }

  private:
    friend class faulty_link;

    fault how_ = fault::lost;
    int step_ = -1;
    int count_ = 0;
    bool struck_ = false;
    int links_ = 0;
};

/// Makes `fault` a scheme. Repeating it does nothing.
void register_fault_transport();

} // namespace cles::test
