// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/fleet/fleet_authority.hpp"
#include "security/fleet/key_directory.hpp"
#include "support/temporary_folder.hpp"

#include <string>

/// A fleet of car1 and car2, each with a directory.
class fleet_folder {
  public:
    fleet_folder() {
        auto authority = cles::security::fleet_authority::found(cles::security::signing_key::generate());
        for (const auto* car : {"car1", "car2"}) {
            const auto directory = cles::security::key_directory::create(of(car));
            authority.add(directory.create_key(car).public_part(), {});
        }
        for (const auto* car : {"car1", "car2"}) {
            cles::security::key_directory{of(car)}.store_roster(authority.newest());
        }
    }
    fleet_folder(const fleet_folder&) = delete;
    fleet_folder& operator=(const fleet_folder&) = delete;
    [[nodiscard]] std::string of(const std::string& car) const { return (folder_ / car).string(); }

  private:
    cles::test::temporary_folder folder_{"cles-perf"};
};
