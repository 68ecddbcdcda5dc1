// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>
#include <cles/plugin_abi.h>
#include <cles/plugin_text.hpp>

#include <atomic>
#include <functional>
#include <string>
#include <string_view>
#include <thread>
#include <utility>

namespace cles::runtime {

/// A request that a plugin's job has sent: the plugin is told the answer exactly once, even where it never comes, and
/// never from inside the call that asks.
class plugin_question {
  public:
    /// Has something called on another thread, soon.
    using elsewhere = std::function<void(std::function<void()>)>;

    plugin_question(const cles_ask& ask, elsewhere later)
        : answered_(ask.answered), progress_(ask.progress), user_(ask.user), later_(std::move(later)),
          asking_(std::this_thread::get_id()) {}
    plugin_question(const plugin_question&) = delete;
    plugin_question& operator=(const plugin_question&) = delete;
    ~plugin_question() { answer(errc::unavailable, "{}", "the node has stopped"); }

    /// The call that asks is about to return: from now on this thread may be told too.
    void asked() noexcept { asking_ = std::thread::id{}; }

    void answer(boost::system::error_code code, std::string_view json, std::string_view message) noexcept {
        if (over_.exchange(true) || answered_ == nullptr) {
            return;
        }
        const auto name = !code ? std::string_view{}
                                : wire_name(code.category() == error_category() ? static_cast<errc>(code.value())
                                                                                : errc::unavailable);
        const auto result = code ? std::string_view{"{}"} : json;
        try {
            if (asking_.load() == std::this_thread::get_id()) {
                later_([call = answered_, user = user_, name, result = std::string{result},
                        words = std::string{message}] { tell(call, user, name, result, words); });
                return;
            }
        } catch (...) { // no memory, no thread: better here than never
        }
        tell(answered_, user_, name, result, message);
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
    // \param name of the error; one of those in the table, which stays
    static void tell(decltype(cles_ask::answered) call, void* user, std::string_view name, std::string_view json,
                     std::string_view message) noexcept {
        try {
            call(user, detail::abi_text(name), detail::abi_text(json), detail::abi_text(message));
        } catch (...) { // a plugin's mistake is not ours
        }
    }

    decltype(cles_ask::answered) answered_;
    decltype(cles_ask::progress) progress_;
    void* user_;
    elsewhere later_;
    std::atomic<std::thread::id> asking_;
    std::atomic<bool> over_{false};
};

} // namespace cles::runtime
