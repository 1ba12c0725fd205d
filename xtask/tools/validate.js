// Checks glTF files with the Khronos validator: any error or warning fails.
import { readFileSync } from "node:fs";
import { dirname, join } from "node:path";
import validator from "gltf-validator";

let failed = false;
for (const path of process.argv.slice(2)) {
  const report = await validator.validateBytes(new Uint8Array(readFileSync(path)), {
    uri: path,
    externalResourceFunction: async (uri) => new Uint8Array(readFileSync(join(dirname(path), decodeURIComponent(uri)))),
  });
  const { numErrors, numWarnings, messages } = report.issues;
  console.log(`${path}: ${numErrors} errors, ${numWarnings} warnings`);
  for (const { severity, code, message, pointer } of messages.filter((issue) => issue.severity < 2)) {
    failed = true;
    console.log(`  ${["error", "warning"][severity]} ${code} at ${pointer}: ${message}`);
  }
}
process.exit(failed ? 1 : 0);
