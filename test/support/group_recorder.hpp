// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "port/group_port.hpp"

#include <boost/system/error_code.hpp>

#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::test {

/// A source in the group that is not the node under test.
constexpr core::group_source source_at(std::uint16_t port) { return {.address = 0x7f000001, .port = port}; }

/// Records what a node sends to its group.
class group_recorder final : public core::group_port {
  public:
    explicit group_recorder(const core::group_source& self = source_at(4000)) : self_(self) {}

    void start(core::group_listener&) override {}
    core::datagrams_done send(core::datagram_list all) override {
        core::datagrams_done taken;
        for (; !all.empty(); all.drop_first()) {
            const auto one = all.first();
            if (failure) {
                ++taken.failed;
                taken.why = failure;
            } else {
                sent_.emplace_back(one.substr(0, one.size() - (one.ends_with('\n') ? 1 : 0)));
            }
            ++taken.count;
            taken.bytes += one.size();
        }
        return taken;
    }
    void send_to(const core::group_source&, std::string_view) override {}
    void receive_own() override {}
    [[nodiscard]] std::size_t unsent() const noexcept override { return writable ? 0 : 1; }
    void close() override {}
    [[nodiscard]] const core::group_source& source() const noexcept override { return self_; }

    std::vector<std::string> take() { return std::exchange(sent_, {}); }
    [[nodiscard]] std::size_t count() const { return sent_.size(); }
    /// For a session, which does not own it.
    [[nodiscard]] std::shared_ptr<core::group_port> share() { return {std::shared_ptr<void>{}, this}; }

    bool writable = true;
    boost::system::error_code failure{}; // if set, nothing is sent

  private:
    core::group_source self_;
    std::vector<std::string> sent_;
};

} // namespace cles::test
