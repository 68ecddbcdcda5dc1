// SPDX-License-Identifier: BSL-1.0
#include "simulation/secured/virtual_fleet.hpp"

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <span>
#include <utility>

namespace cles::simulation {
namespace {

// In memory if possible, since nodes wait until their roster is stored.
std::filesystem::path fast_place() {
    const std::filesystem::path memory{"/dev/shm"};
    return std::filesystem::is_directory(memory) ? memory : std::filesystem::temp_directory_path();
}

} // namespace

virtual_fleet::virtual_fleet(std::vector<std::string> names)
    : names_(std::move(names)), folder_("cles-simulation", fast_place()), key_(security::signing_key::generate()),
      authority_(security::fleet_authority::found(security::signing_key{key_.seed().copy()})) {
    for (std::size_t node = 0; node < names_.size(); ++node) {
        identities_.push_back(
            security::key_directory::create(directory_of(node)).create_key(names_[node]).public_part());
    }
    authority_->add(identities_);
    first_ = newest().line();
    for (std::size_t node = 0; node < names_.size(); ++node) {
        give(node);
    }
}

std::string virtual_fleet::directory_of(std::size_t node) const { return (folder_ / names_[node]).string(); }

void virtual_fleet::remove(std::size_t node) {
    if (is_member(node) && newest().members().size() > 2) {
        authority_->remove(names_[node]);
    }
}

void virtual_fleet::add(std::size_t node) {
    if (!is_member(node)) {
        authority_->add(identities_[node]);
    }
}

void virtual_fleet::set_rights(std::size_t node, const security::member_rights& rights) {
    if (is_member(node)) {
        authority_->set_rights(names_[node], rights);
    }
}

void virtual_fleet::give(std::size_t node) const { write(node, newest()); }

// The time of the file is that of its version, so that nodes notice the change however fast it follows another one.
void virtual_fleet::write(std::size_t node, const security::roster& which) const {
    if (which.find(names_[node]) == nullptr) {
        return; // it is not given to others
    }
    const security::key_directory directory{directory_of(node)};
    if (directory.store_roster(which)) {
        std::filesystem::last_write_time(directory.folder().path_of("roster"),
                                         std::filesystem::file_time_type{std::chrono::seconds{which.version()}});
    }
}

void virtual_fleet::fork(std::size_t one, std::size_t other) {
    security::fleet_authority second{security::signing_key{key_.seed().copy()}, share()};
    second.rotate();
    write(other, second.newest());
    authority_->add(std::span<const security::public_identity>{}); // only the version changes
    give(one);
}

void virtual_fleet::restore() {
    for (std::size_t node = 0; node < names_.size(); ++node) {
        if (!is_member(node)) { // it does not start with a roster that does not contain it
            add(node);
            give(node);
        }
        const auto* const member = newest().find(names_[node]);
        if (member->may || member->offers) {
            authority_->set_rights(names_[node], {});
        }
    }
    rotate();
}

void virtual_fleet::roll_back(std::size_t node) const {
    const auto file = security::key_directory{directory_of(node)}.folder().path_of("roster");
    std::filesystem::remove(file);
    write(node, *security::roster::read(first_, newest().fleet()));
}

} // namespace cles::simulation
