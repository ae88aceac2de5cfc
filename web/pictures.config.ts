import config from "./playwright.config";

// Pictures of the page for the documents: `npm run pictures`.
export default { ...config, testDir: "pictures", timeout: 400_000 };
