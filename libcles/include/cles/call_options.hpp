// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <utility>

namespace cles {

/// What a caller may say of one request. Set by chaining: `cles::call_options{}.deadline(200ms).at("tcp://10.0.0.2")`.
/// Where a value is not what it may be, the operation fails with `invalid_option`, and its message names the option.
class call_options {
  public:
    call_options() = default;

    /// How long to wait for the answer; the peer is told. 0: the protocol's default (5 s, DELEGATE 30 s). More than a
    /// day counts as a day; less than 0 is refused.
    call_options& deadline(std::chrono::milliseconds limit) {
        deadline_ = limit;
        return *this;
    }
    /// Where to send it, instead of asking the directory for the target's name.
    call_options& at(std::string_view url) {
        at_ = url;
        return *this;
    }
    /// A small request that must not wait behind large ones: it travels on a link of its own, and its answer goes
    /// before others that wait at the peer. A peer that does not know the adverb `urgent` answers it in its turn.
    call_options& urgent(bool value = true) {
        urgent_ = value;
        return *this;
    }
    /// Where the peer's own words go if the request fails; written before the request completes, which it must outlive.
    call_options& diagnostics(std::string& text) {
        diagnostics_ = &text;
        return *this;
    }
    /// Called for each report of a DELEGATE's progress with a fraction from 0 to 1 and a JSON object. It runs in line,
    /// on the service's executor; asks the peer for reports.
    call_options& on_progress(std::function<void(double, std::string_view)> callback) {
        on_progress_ = std::move(callback);
        return *this;
    }

    std::chrono::milliseconds deadline_{0};
    std::string at_{};
    bool urgent_ = false;
    std::string* diagnostics_ = nullptr;
    std::function<void(double, std::string_view)> on_progress_{};
};

/// What a binder may say of one binding.
class bind_options : public call_options {
  public:
    bind_options() = default;

    /// At most one update in so long, always the newest. 0: every one. More than a day counts as a day; less than 0 is
    /// refused.
    bind_options& every(std::chrono::milliseconds interval) {
        every_ = interval;
        return *this;
    }
    /// How many updates the publisher queues while this binder is slow: 1 to 65536; 0: the protocol's default, 64. More
    /// is refused.
    bind_options& keep(std::uint32_t updates) {
        keep_ = updates;
        return *this;
    }
    /// Binds by the multicast group instead of a link, so that one datagram of the publisher serves all who do; `all:`
    /// goes that way by itself. Then `every` and `keep` have no effect, and nothing is answered: the feed begins with
    /// the publisher's last value as an update, and does not tell where there is no publisher.
    bind_options& multicast(bool wanted = true) {
        multicast_ = wanted;
        return *this;
    }
    bind_options& deadline(std::chrono::milliseconds limit) {
        call_options::deadline(limit);
        return *this;
    }
    bind_options& at(std::string_view url) {
        call_options::at(url);
        return *this;
    }
    bind_options& diagnostics(std::string& text) {
        call_options::diagnostics(text);
        return *this;
    }

    std::chrono::milliseconds every_{0};
    std::uint32_t keep_ = 0;
    bool multicast_ = false;
};

} // namespace cles
