// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>

#include <boost/describe/class.hpp>

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace jadc2 {

/// How each frame ended, and which node gets the next one. It only decides; its caller sends and waits.
///
/// The first frame goes to any node that offers the task, and the following ones to the node that took it, since it
/// knows the stream. If that node is lost, the next frame goes to any node again. No frame is sent twice, because the
/// next one is newer.
class frame_fates {
  public:
    struct totals {
        std::uint64_t captured = 0, done = 0, failed = 0, skipped = 0; ///< skipped: the previous one was still open
        std::map<std::string, std::uint64_t> failures{};               ///< by the name of the error
        std::vector<std::string> nodes{};                              ///< that processed frames, in their order
    };

    /// The node for the next frame, or `any`.
    [[nodiscard]] const std::string& target() const noexcept { return target_; }
    /// Why the last frame failed; empty if it did not.
    [[nodiscard]] const std::string& error() const noexcept { return error_; }
    [[nodiscard]] bool open() const noexcept { return open_; }
    [[nodiscard]] const totals& sums() const noexcept { return sums_; }

    void captured() noexcept {
        ++sums_.captured;
        open_ = true;
    }
    /// The previous frame is still open, so this one is not captured.
    void skipped() noexcept {
        ++sums_.captured;
        ++sums_.skipped;
    }
    /// \return whether it is another node than before
    bool done(std::string_view by);
    /// \return whether the previous frame did not fail with this error
    bool failed(const cles::error& why);

  private:
    std::string target_ = "any";
    std::string error_;
    bool open_ = false;
    totals sums_;
};
BOOST_DESCRIBE_STRUCT(frame_fates::totals, (), (captured, done, failed, skipped, failures, nodes))

} // namespace jadc2
