import type { KnipConfig } from "knip";

export default {
  project: ["src/**!", "public/**!", "*.ts"],
  ignore: ["src/api/generated/**"],
  // Without the tests: what a file itself uses may be exported for its test, anything else is dead.
  ignoreExportsUsedInFile: process.argv.includes("--production"),
} satisfies KnipConfig;
