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

/// What became of each frame, and who is asked for the next one. It decides; asking and waiting is its caller's.
///
/// The first frame goes to any node that offers the task, and the following ones to the node that took it, since it
/// knows the stream. Where that is lost, the next frame is for any again. No frame is sent twice: the next one is
/// newer.
class frame_fates {
  public:
    struct totals {
        std::uint64_t captured = 0, done = 0, failed = 0, skipped = 0; ///< skipped: the last one was still open
        std::map<std::string, std::uint64_t> failures{};               ///< by the error's name
        std::vector<std::string> nodes{};                              ///< who processed, in their order
    };

    /// Who is asked for the next frame: a node, or `any`.
    [[nodiscard]] const std::string& target() const noexcept { return target_; }
    /// Why the last frame failed; empty where it did not.
    [[nodiscard]] const std::string& trouble() const noexcept { return trouble_; }
    [[nodiscard]] bool open() const noexcept { return open_; }
    [[nodiscard]] const totals& sums() const noexcept { return sums_; }

    void captured() noexcept {
        ++sums_.captured;
        open_ = true;
    }
    /// It was not even captured, since the last one is open.
    void skipped() noexcept {
        ++sums_.captured;
        ++sums_.skipped;
    }
    /// True where the node is another than before.
    bool done(std::string_view by);
    /// True where this is news: the frame before had not failed so.
    bool failed(const cles::error& why);

  private:
    std::string target_ = "any";
    std::string trouble_;
    bool open_ = false;
    totals sums_;
};
BOOST_DESCRIBE_STRUCT(frame_fates::totals, (), (captured, done, failed, skipped, failures, nodes))

} // namespace jadc2
