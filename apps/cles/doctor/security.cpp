// SPDX-License-Identifier: BSL-1.0
#include "doctor/checks.hpp"

#ifdef CLES_SECURITY

#include <cles/security/access.hpp>
#include <cles/security/core_dumps.hpp>
#include <cles/security/fleet_files.hpp>
#include <cles/security/node_files.hpp>

#include <cstddef>
#include <exception>
#include <string>

#include <sys/resource.h>

namespace tool {
namespace {

namespace security = cles::security;

void check_membership(const security::node_description& node, const std::string& directory, findings& found) {
    if (!node.rights) {
        found.failure("keys", node.name + " is not a member of a fleet: " + node.reason,
                      "at the fleet's authority: cles fleet add " + node.name +
                          ".pub --may RIGHT; then here: cles keys join " + node.name + ".join --keys " + directory);
        return;
    }
    found.ok("keys", node.name + " is a member of the fleet " + node.fleet + ", by version " +
                         std::to_string(node.version) + " of the roster");
    for (const auto& warning : node.warnings) { // of rosters that differ in one version
        found.warning("keys", warning, "make the next version at the fleet's authority: cles fleet rotate");
    }
}

void check_rules(const security::node_description& node, const std::string& directory, findings& found) {
    if (!node.rules_error.empty()) {
        found.failure("keys", "every request is denied: " + node.rules_error,
                      "correct it; cles access MEMBER VERB NOUN --keys " + directory + " says what the rules permit");
    } else if (node.rules != 0) {
        found.ok("keys", std::to_string(node.rules) + (node.rules == 1 ? " local rule" : " local rules"));
    }
}

// Whether another member exists, but there is none of which the node may request this.
bool is_denied_by_all(const std::string& directory, const std::string& name, cles::verb asked) {
    constexpr std::size_t enough = 64; // each reads the directory
    std::size_t others = 0;
    for (const auto& member : security::describe_fleet(directory).members) {
        if (member.name == name) {
            continue;
        }
        if (++others > enough) {
            return false; // nobody knows what holds for the others
        }
        const security::access_question question{.requester = name, .asked = asked, .noun = member.name + ":cles"};
        if (security::explain_access(directory, question).allowed) {
            return false;
        }
    }
    return others != 0;
}

// What a member needs in order to find nodes (docs/security.md, "Rights"). Some members have fewer rights on purpose.
// \return whether it may bind 'cles' of any
bool check_rights(const std::string& name, const std::string& directory, findings& found) {
    const bool hears = !is_denied_by_all(directory, name, cles::verb::bind);
    const bool asks = !is_denied_by_all(directory, name, cles::verb::pull);
    if (hears && asks) {
        return true;
    }
    const std::string lacking = hears ? "PULL" : asks ? "BIND" : "BIND and PULL";
    found.warning("keys",
                  name + " may not " + lacking + " 'cles' of any other member, so it cannot find " +
                      (hears ? "out what they offer" : "them"),
                  "at the fleet's authority: cles fleet rights " + name +
                      " --may 'pull,bind *:cles' --may 'pull,push *:cles/peers', and its other rights");
    return hears;
}

void check_locked_memory(findings& found) {
    constexpr rlim_t needed = rlim_t{2048} * 1024; // secrets of sessions, and OpenSSL's heap for keys
    rlimit locked{};
    if (::getrlimit(RLIMIT_MEMLOCK, &locked) == 0 && locked.rlim_cur < needed) {
        found.warning("keys",
                      "a program may lock only " + std::to_string(locked.rlim_cur / 1024) +
                          " KiB of memory, so keys may be written to swap",
                      "ulimit -l " + std::to_string(needed / 1024) + ", or LimitMEMLOCK= in the unit file");
    }
}

} // namespace

checked_key check_keys(const std::string& directory, findings& found) {
    checked_key key;
    if (directory.empty()) {
        return key;
    }
    check_locked_memory(found);
    security::forbid_core_dumps();
    try {
        const auto node = security::describe_node(directory);
        check_membership(node, directory, found);
        check_rules(node, directory, found);
        if (node.rights && node.rules_error.empty()) {
            key.may_ask_group = check_rights(node.name, directory, found);
        }
        key.is_usable = node.rights.has_value();
    } catch (const std::exception& e) {
        found.failure("keys", e.what(), "correct it, and run cles keys show --keys " + directory);
        key.is_usable = false;
    }
    return key;
}

} // namespace tool

#else

namespace tool {

checked_key check_keys(const std::string& directory, findings& found) {
    if (!directory.empty()) {
        found.failure("keys", "this cles was built without security", "use another one, or leave out --keys");
    }
    return {.is_usable = directory.empty()};
}

} // namespace tool

#endif
