// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <string_view>
#include <utility>

namespace cles::runtime {

/// The trace of the request whose handler runs on this thread, for the log.
class current_trace {
  public:
    /// \param trace that of the request (`request::trace`), which outlives this
    explicit current_trace(std::string_view trace) noexcept : before_(std::exchange(trace_, trace)) {}
    current_trace(const current_trace&) = delete;
    current_trace& operator=(const current_trace&) = delete;
    ~current_trace() { trace_ = before_; }

    /// Its id; empty if there is none.
    [[nodiscard]] static std::string_view id() noexcept { return id_in(trace_); }
    /// The id in what `request::trace` returns.
    [[nodiscard]] static std::string_view id_in(std::string_view trace) noexcept {
        constexpr std::size_t version = 3; // "00-"
        constexpr std::size_t digits = 32;
        return trace.empty() ? trace : trace.substr(version, digits);
    }

  private:
    static thread_local std::string_view trace_;

    std::string_view before_;
};

inline thread_local std::string_view current_trace::trace_;

} // namespace cles::runtime
