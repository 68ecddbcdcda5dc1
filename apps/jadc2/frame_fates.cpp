// SPDX-License-Identifier: BSL-1.0
#include "frame_fates.hpp"

namespace jadc2 {

using cles::errc;

bool frame_fates::done(std::string_view by) {
    open_ = false;
    ++sums_.done;
    error_.clear();
    target_ = by;
    if (!sums_.nodes.empty() && sums_.nodes.back() == by) {
        return false;
    }
    constexpr std::size_t most = 1000; // enough for days of changes
    if (sums_.nodes.size() < most) {
        sums_.nodes.emplace_back(by);
    }
    return true;
}

bool frame_fates::failed(const cles::error& why) {
    open_ = false;
    ++sums_.failed;
    const auto code = why.code();
    const bool ours = code.category() == cles::error_category();
    ++sums_.failures[ours ? std::string{cles::wire_name(static_cast<errc>(code.value()))} : "unreachable"];
    // A node that is busy, or rejects a frame, is still there and knows the stream.
    if (!ours || code == errc::unavailable || code == errc::deadline || code == errc::no_target ||
        code == errc::no_task) {
        target_ = "any";
    }
    const bool is_new = error_ != why.what();
    error_ = why.what();
    return is_new;
}

} // namespace jadc2
