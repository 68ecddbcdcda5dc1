// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "federation/simulated_nats.hpp"
#include "security/fleet/fleet.hpp"
#include "security/fleet_fixture.hpp"
#include "security/messages/sealed_messages.hpp"
#include "security/sealed_network.hpp"

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace cles::bridging::test {

/// A member of a fleet that is a bridge, with real seals. A newer roster that reaches it through NATS comes into force.
struct sealed_site {
    sealed_site(simulated_nats& nats, const security::fleet_authority& authority, std::string pool, std::string name,
                std::uint64_t seed)
        : random(seed), fleet(name, security::test::key_of(name), authority.share()),
          at(nats, std::move(pool), std::move(name),
             site_security{.make_seal = [this] { return make_seal(); },
                           .roster_version = [this] { return fleet.in_force().version(); }}) {}
    sealed_site(const sealed_site&) = delete;
    sealed_site& operator=(const sealed_site&) = delete;
    ~sealed_site() = default;

    site* operator->() noexcept { return &at; }
    [[nodiscard]] const bridge_id& id() { return at.core().self(); }
    /// As the sender of a message that was opened.
    [[nodiscard]] message_sender sender() { return {fleet.name(), id().instance}; }

    security::test::seeded_entropy random;
    security::fleet fleet;
    site at;

  private:
    std::unique_ptr<core::message_seal> make_seal() {
        return std::make_unique<security::sealed_messages>(fleet, random, [this](std::string_view line) {
            if (fleet.offer(line) == security::fleet::verdict::adopted) {
                at.change_security();
            }
        });
    }
};

} // namespace cles::bridging::test
