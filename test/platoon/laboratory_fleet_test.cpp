// SPDX-License-Identifier: BSL-1.0
#include "output/errors.hpp"
#include "platoon/drive/laboratory_fleet.hpp"

#ifdef CLES_SECURITY
#include <cles/security/access.hpp>
#include <cles/security/fleet_files.hpp>
#include <cles/security/node_files.hpp>
#endif

#include <boost/test/unit_test.hpp>

#include <filesystem>
#include <string>

#include <sys/prctl.h>

BOOST_AUTO_TEST_SUITE(laboratory_fleet)

#ifdef CLES_SECURITY

namespace {

bool allows(const platoon::laboratory_fleet& fleet, const std::string& requester, cles::verb asked,
            const std::string& noun) {
    return cles::security::explain_access(fleet.folder() + "/v1",
                                          {.requester = requester, .asked = asked, .noun = noun})
        .allowed;
}

} // namespace

BOOST_AUTO_TEST_CASE(each_has_its_own_key) {
    const platoon::laboratory_fleet made{2};
    const auto found = cles::security::describe_fleet(made.folder());
    BOOST_TEST(found.members.size() == 3U);
    for (const std::string name : {"operator", "v0", "v1"}) {
        const auto node = cles::security::describe_node(made.folder() + "/" + name);
        BOOST_TEST(node.name == name);
        BOOST_TEST(node.version == found.version);
        BOOST_TEST(node.rights.has_value());
    }
}

BOOST_AUTO_TEST_CASE(whoever_has_all_keys_leaves_no_core_dump) {
    BOOST_REQUIRE(::prctl(PR_SET_DUMPABLE, 1) == 0);
    const platoon::laboratory_fleet made{1};
    BOOST_TEST(::prctl(PR_GET_DUMPABLE) == 0);
}

BOOST_AUTO_TEST_CASE(only_this_user_can_read_it_and_it_is_removed) {
    std::string folder;
    {
        const platoon::laboratory_fleet made{1};
        folder = made.folder();
        BOOST_TEST((std::filesystem::status(folder).permissions() == std::filesystem::perms::owner_all));
    }
    BOOST_TEST(!std::filesystem::exists(folder));
}

BOOST_AUTO_TEST_CASE(each_may_do_what_it_needs) {
    using cles::verb;
    const platoon::laboratory_fleet made{3};
    for (const auto* const who : {"v0", "operator"}) {
        BOOST_TEST(allows(made, who, verb::bind, "v1:state"), who);
        BOOST_TEST(allows(made, who, verb::bind, "v1:cles"), who);
        BOOST_TEST(!allows(made, who, verb::push, "v1:state"), who);
        BOOST_TEST(!allows(made, who, verb::pull, "v1:cles"), who);
    }
    BOOST_TEST(allows(made, "v0", verb::push, "v1:join"));
    BOOST_TEST(!allows(made, "v0", verb::push, "v1:leave"));
    BOOST_TEST(!allows(made, "v0", verb::push, "v1:split"));
    BOOST_TEST(allows(made, "operator", verb::push, "v1:leave"));
    BOOST_TEST(allows(made, "operator", verb::push, "v1:split"));
    BOOST_TEST(!allows(made, "operator", verb::push, "v1:join"));
}

BOOST_AUTO_TEST_CASE(the_operator_offers_nothing) {
    const platoon::laboratory_fleet made{1};
    BOOST_TEST(!cles::security::explain_access(made.folder() + "/operator",
                                               {.requester = "v0", .asked = cles::verb::bind, .noun = "operator:state"})
                    .allowed);
}

#else

BOOST_AUTO_TEST_CASE(there_is_none_without_security) {
    BOOST_CHECK_THROW(platoon::laboratory_fleet{1}, tool::usage_error);
}

#endif

BOOST_AUTO_TEST_SUITE_END()
