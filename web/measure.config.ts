import config from "./playwright.config";

// Figures of the page for the documents: `npm run measure`.
export default { ...config, testDir: "measure", timeout: 400_000 };
