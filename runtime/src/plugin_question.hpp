// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>
#include <cles/plugin_abi.h>
#include <cles/plugin_text.hpp>

#include <atomic>
#include <string_view>

namespace cles::runtime {

/// A request that a plugin's job has sent: the plugin is told the answer exactly once, even where it never comes.
class plugin_question {
  public:
    explicit plugin_question(const cles_ask& ask) noexcept
        : answered_(ask.answered), progress_(ask.progress), user_(ask.user) {}
    plugin_question(const plugin_question&) = delete;
    plugin_question& operator=(const plugin_question&) = delete;
    ~plugin_question() { answer(errc::unavailable, "{}", "the node has stopped"); }

    void answer(boost::system::error_code code, std::string_view json, std::string_view message) noexcept {
        if (over_.exchange(true) || answered_ == nullptr) {
            return;
        }
        const auto name = !code ? std::string_view{}
                                : wire_name(code.category() == error_category() ? static_cast<errc>(code.value())
                                                                                : errc::unavailable);
        try {
            answered_(user_, detail::abi_text(name), detail::abi_text(code ? "{}" : json), detail::abi_text(message));
        } catch (...) { // a plugin's mistake is not ours
        }
    }

    void report(double fraction, std::string_view json) noexcept {
        if (progress_ != nullptr && !over_) {
            try {
                progress_(user_, fraction, detail::abi_text(json));
            } catch (...) { // as above
            }
        }
    }

  private:
    decltype(cles_ask::answered) answered_;
    decltype(cles_ask::progress) progress_;
    void* user_;
    std::atomic<bool> over_{false};
};

} // namespace cles::runtime
