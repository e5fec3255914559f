# Writes OUTPUT, a C++ file defining exmat::embedded_schema(name) over the JSON files of SCHEMAS.
set(cases "")
foreach(file IN LISTS SCHEMAS)
  get_filename_component(name ${file} NAME_WE)
  file(READ ${file} text)
  string(LENGTH "${text}" length)
  # Pieces, since a string literal may hold no more than 65,536 characters.
  set(pieces "")
  set(offset 0)
  while(offset LESS length)
    string(SUBSTRING "${text}" ${offset} 8000 piece)
    string(APPEND pieces "R\"~json~(${piece})~json~\"\n")
    math(EXPR offset "${offset} + 8000")
  endwhile()
  string(APPEND cases "  if (name == \"${name}\") return std::string_view{${pieces}};\n")
endforeach()
file(WRITE ${OUTPUT} "#include <stdexcept>
#include <string>

#include \"common/config/embedded_schema.h\"

namespace exmat {

std::string_view embedded_schema(std::string_view name) {
${cases}  throw std::logic_error(\"no such schema: \" + std::string(name));
}

}  // namespace exmat
")
