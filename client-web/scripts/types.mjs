// Writes generated/api.ts, the types of the HTTP interface, from openapi.json; does nothing while that is the same.

import { createHash } from "node:crypto";
import { existsSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { URL } from "node:url";
import openapiTS, { astToString } from "openapi-typescript";
import ts from "typescript";

const folder = new URL("../", import.meta.url);
const from = new URL("openapi.json", folder);
const to = new URL("generated/api.ts", folder);

const document = readFileSync(from);
const versions = JSON.parse(readFileSync(new URL("package.json", folder), "utf8")).devDependencies;
const made = createHash("sha256").update(document).update(versions["openapi-typescript"]).update(readFileSync(new URL(import.meta.url)));
const head = `// Written by \`npm run types\` from openapi.json: ${made.digest("hex")}\n`;

if (!existsSync(to) || !readFileSync(to, "utf8").startsWith(head)) {
  const types = await openapiTS(from, {
    immutable: true,
    // Lists of a fixed length are tuples.
    arrayLength: true,
    // What has a default may be left out of a request.
    defaultNonNullable: false,
  });
  mkdirSync(new URL("./", to), { recursive: true });
  writeFileSync(to, head + astToString(types.map(withReadonlyTuples)));
}

/** Tuples are left out of what `immutable` does. */
function withReadonlyTuples(root) {
  const visit = (node) => {
    const inner = ts.visitEachChild(node, visit, undefined);
    return ts.isTupleTypeNode(inner) ? ts.factory.createTypeOperatorNode(ts.SyntaxKind.ReadonlyKeyword, inner) : inner;
  };
  return visit(root);
}
