// In sanitizer builds of the offline stage: libraries stay loaded to the end. The leak sanitizer names a leak by the
// library that it comes from, and leaks.supp needs these names; MPI unloads its plugins before leaks are looked for.
extern "C" int dlclose(void* /*library*/) { return 0; }

// By this name the linker takes this file along: dlclose alone is in the sanitizer's library, too.
extern "C" const int exmat_keeps_libraries_loaded = 1;
